// Steps of many trees that nothing but contacts couples: R(x) = 0 (127)-(142), its corrections and its contact problems,
// with a block for each tree and the rows of a contact in the coordinates of the one or two trees that it touches.
//
// The rows and the laws of contacts are those of the kernel, on the blocks of kernel.h.
#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "contact_solver.hpp"
#include "forest.hpp"

namespace nga {

// Forces of the scene on all trees with their derivatives by q and v, square by rows; NULL where there are none.
struct TreeLoads {
    const double *tau = nullptr, *K = nullptr, *D = nullptr;
};

class Crowd {
public:
    using Matrix = Eigen::MatrixXd;
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

    Crowd(const std::string &model, std::vector<double> reach, bool flat);

    // Takes a subset of the contacts, whose blocks stay with the caller; returns its number.
    int add(const kernel::Plan &plan, const std::vector<int> &bodies);

    // What restitution adds to the rates, into the block of the step, at the start of it.
    void rebound(int subset, double *step, const Vector &q, const Vector &v);

    // R(x) at an iterate whose motion is known (`nga_move`), into its block of rows; its error is returned, and where the
    // bodies are is kept for the functions below, which go on from there.
    double evaluate(int subset, double *step, double *iterate, double *rows, const Vector &q, const TreeLoads &loads);
    const Vector &configuration() const { return q_; }

    // Change of y that the residuals of a, U and Q ask for.
    Vector response(int subset, const double *step, double *rows);

    // The scaled Newton matrix (143), reduced to the multipliers, by columns, and its right side.
    struct Linear {
        std::vector<int> starts, rows;
        std::vector<double> values;
        Vector right;
    };
    Linear linear(int subset, double *step, double *iterate, double *rows);

    // The next iterate, from the solution of that.
    void advance(int subset, double *step, double *iterate, double *rows, const Vector &z, double *next);

    // The next iterate from the contact problems of gaps, velocities and accelerations of the linearised step, one after
    // the other, and the index sets A, B, C, stick and stick_a of the three.
    void round(int subset, double *step, double *iterate, double *rows, double *next, double *sets);

    // The iterate with the given forces of gaps and of all rows on the other levels, with a, U and Q that go with them.
    void with_forces(int subset, double *step, double *iterate, double *rows, const Vector &kappa, const Vector &P,
                     const Vector &la, double *next);

    // So far: evaluations, corrections, rounds, and contact problems with the corrections in them.
    long evaluations = 0, corrections = 0, rounds = 0, problems = 0, inner = 0;

private:
    struct Subset {
        kernel::Plan plan;
        std::vector<const double *> poses;
        std::vector<Leg> legs;  // group is the contact, `at` the place of its rows in W, X and Y
        int parts;              // entries of those
        int rows;
        int contact_rows(int i) const;
        int row(int contact, int i) const;
    };
    // Velocities or accelerations: y = b + G P, and from which forces to go on.
    struct Level {
        const std::vector<Matrix> *A, *by_A;
        Vector b, guess;
    };
    struct Blocks;
    Blocks blocks(const Subset &subset, const kernel::Step &s, const kernel::Iterate &it, const kernel::Rows &r) const;
    Matrix answer(const Subset &subset, const kernel::Step &s, const Leg &leg, const Matrix &C, const Matrix &F) const;
    Eigen::Map<const Rows> part(const std::vector<double> &of, const Subset &subset, const Leg &leg) const;
    Vector collect(const Subset &subset, const Vector &forces) const;
    void spread(const Subset &subset, const std::vector<double> &of, const Vector &x, Vector &y) const;
    Vector by(const std::vector<Matrix> &blocks, const Vector &x) const;
    Vector across(const std::vector<Matrix> &by_A, const Subset &subset, const Vector &P) const;
    void scale(Subset &subset, const kernel::Step &s, const kernel::Iterate &it, const kernel::Rows &r);
    void find_residuals(const Subset &subset, const kernel::Step &s, const kernel::Iterate &it, kernel::Rows &r,
                        const Vector &kappa);
    void differentiate(const Subset &subset, const kernel::Step &s, const kernel::Rows &r);
    void cut(const Subset &subset, const double *of_all, std::vector<double> &parts) const;
    Level level(const Subset &subset, bool held, const double *y, const Vector &P) const;
    Problem problem_of(const Subset &subset, const Level &at, const std::vector<char> &touches) const;
    bool solve(Problem &problem, const Subset &subset, const std::vector<char> &touches, Vector &P, double tolerance);
    Vector forces(const Subset &subset, const Level &at, const std::vector<char> &touches, std::vector<char> slips,
                  const Vector *slip, double tolerance);
    Vector gap_forces(const Subset &subset, const kernel::Step &s, const Vector &gaps, const Vector &kappa,
                      const Vector &share);
    Vector slip_of(const Subset &subset, const Level &at, const Vector &P) const;
    std::vector<char> moves(const Subset &subset, const Level &at, const Vector &P, double still) const;

    Forest forest_;
    std::vector<double> reach_;
    bool flat_;
    kernel::Live live_{};
    std::vector<std::unique_ptr<Subset>> subsets_;
    Vector q0_, q_, dq_, residual_;
    std::vector<double> tau_, nothing_;
    std::vector<double> W_, X_, Y_, dense_X_, dense_Y_;
    std::vector<Matrix> M_, K_, D_, T_, S_, KT_, held_, by_M_, by_S_, by_held_;
    bool loaded_ = false;
    ContactSolver<6> bodies_;
    ContactSolver<Eigen::Dynamic> trees_;
};

}  // namespace nga
