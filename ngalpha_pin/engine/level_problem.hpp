// One frictional contact problem of few bodies: Signorini's and Coulomb's laws on y = b + G P, by sweeps and by Newton's
// method; the twin of numerics/gauss_seidel.py and proximal_newton.py, whose names are used here.
#pragma once
#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace nga {

class LevelProblem {
public:
    using Vector = Eigen::VectorXd;

    // G: by columns, n x n, normal rows first, then friction, then joint friction; of_F: contact of each friction row.
    LevelProblem(Eigen::MatrixXd G, Vector b, Vector mu, std::vector<int> of_F, Vector lower, Vector upper);

    enum class End { converged, open, convex };  // the last one: without friction, and not for Newton's method

    // See `solve_contact_problem`; P is the first guess and then the solution, or where it has got. Returns the sweeps.
    std::pair<End, int> solve(Vector &P, double tol, int max_sweeps, bool patient);

private:
    // Residual and sets of the laws at P, held near a centre.
    struct Laws {
        Vector R, unit, part;
        std::vector<char> kinematic, slips;
        double error = 0.0, rho = 0.0;
        std::string sets() const;
    };
    End proximal_newton(Vector &P, double tol, bool patient);
    bool newton(Vector &P, const Vector &centre, double rho, double tol, int &steps);
    Laws laws(const Vector &P, const Vector &centre, double rho) const;
    Vector step(const Laws &laws) const;
    int sweep(Vector &P, int last, double tol);
    bool convex() const;

    Eigen::MatrixXd G_;
    Vector b_, mu_, lower_, upper_, diagonal_, scale_, root_, y_;
    std::vector<int> of_F_, first_F_, starts_, rows_;  // rows of the entries of G that are not zero, column by column
    std::vector<double> values_, state_;
    int k_, j_, n_;
};

}  // namespace nga
