// One frictional contact problem of many bodies: y = b + J v + E P with v = M^-1 J^T P and a law for each group of rows.
//
// M has a block for each tree that hangs on the world; P are percussions and y velocities, or the same one level up or
// down. E is a compliance within a group. What is solved for lives on the trees, of which there are fewer than rows.
#pragma once
#include <Eigen/LU>
#include <vector>

#include "block_lu.hpp"
#include "contact_laws.hpp"

namespace nga {

using Vector = Eigen::VectorXd;

// Part of the rows of a group that a tree moves: rows x size of the tree numbers from `at` on, by rows.
struct Leg {
    int group, tree, at;
};

struct Problem {
    std::vector<int> sizes;        // velocity coordinates of each tree
    std::vector<double> M;         // its block, by rows, one tree after the other
    std::vector<Group> groups;     // in the order of their rows
    std::vector<Leg> legs;         // in the order of their groups, no tree twice in a group
    std::vector<double> J;         // of the legs
    std::vector<double> bias;      // b
    std::vector<double> compliance;  // E of each group, MOST_ROWS x MOST_ROWS by rows; empty where there is none
};

// The linear algebra of a problem on its trees; keeps its memory and the pattern of its factors from problem to problem.
template <int N>
class TreeOperator {
public:
    using Block = Eigen::Matrix<double, N, N>;
    using Velocity = Eigen::Matrix<double, N, 1>;

    // Blocks and scales of a problem, which has to live as long as it is worked on.
    void prepare(const Problem &problem);

    int rows() const { return static_cast<int>(problem_->bias.size()); }
    const std::vector<Group> &groups() const { return groups_; }

    // y for given percussions; they are kept as those that `local` and `change` go on from.
    void evaluate(const Vector &P, Vector &y);

    // Rows of y of a group, for sweeps.
    void local(int group, const double *P, double *y) const;

    // Let the percussions of a group change by d.
    void change(int group, const double *d);

    // Block of J M^-1 J^T + E of a group, MOST_ROWS x MOST_ROWS by rows.
    const double *own(int group) const { return &own_[group * MOST_ROWS * MOST_ROWS]; }

    // Factorise M + J^T C J, then solve dP = p - C dy with dy = J dv + E dP and M dv = J^T dP.
    void factorise(const std::vector<Response> &responses);
    void step(const std::vector<Response> &responses, Vector &dP, Vector &dy, int refinements = 0);

private:
    int size(int tree) const { return N == Eigen::Dynamic ? problem_->sizes[tree] : N; }
    const double *row(const Leg &leg, int i) const { return &problem_->J[leg.at + i * size(leg.tree)]; }
    void find_graph();
    void eliminate_compliance();
    void collect(const Vector &p);
    void spread(Vector &dy) const;
    void answer(const Vector &p, Vector &dP, Vector &dy) const;
    void comply(const Vector &dP, Vector &dy) const;
    void apply(const Vector &dP, Vector &dy);

    const Problem *problem_ = nullptr;
    std::vector<Group> groups_;
    std::vector<int> first_leg_;
    std::vector<Block> M_, M_inverse_;
    std::vector<double> by_M_, own_;  // M^-1 J^T of the legs, by columns, as J by rows
    std::vector<Velocity> v_, right_;
    std::vector<Eigen::Matrix4d> C_, F_;  // C and the factor of p that the compliance leaves
    Vector p_, rest_, more_;
    Graph graph_;
    BlockLU<N> lu_;
};

}  // namespace nga
