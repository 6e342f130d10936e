// Twin of contact/blocked_tangents.py: whether some friction of a step has a direction in which nothing moves while the
// contact stays closed and the constraints hold. Such steps are for the caller.
#include <Eigen/Dense>
#include <algorithm>

#include "plain_steps.hpp"
#include "tolerances.hpp"

namespace nga {
namespace {

// inverse mass with the normal held, relative to the contact's, below which a direction is still; eigenvalues of the
// constraints below which their forces are not unique
constexpr double IMMOBILE = 1e-11, REDUNDANT = 1e-12;

// Delassus matrix of the first n rows, where the others are constraints that hold.
Eigen::MatrixXd held(const Eigen::MatrixXd &G, int n, double vanishes) {
    const int b = static_cast<int>(G.rows()) - n;
    const Eigen::VectorXd diagonal = G.diagonal().tail(b);
    const Eigen::VectorXd by_root = diagonal.cwiseMax(std::max(vanishes * diagonal.maxCoeff(), TINY)).cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd scaled = by_root.asDiagonal() * G.bottomRightCorner(b, b) * by_root.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> found(scaled);
    const double least = REDUNDANT * found.eigenvalues().cwiseAbs().maxCoeff();
    const Eigen::VectorXd inverse = found.eigenvalues().unaryExpr([least](double x) { return std::abs(x) > least ? 1.0 / x : 0.0; });
    const Eigen::MatrixXd back = G.topRightCorner(n, b) * by_root.asDiagonal() * found.eigenvectors();
    return G.topLeftCorner(n, n) - back * inverse.asDiagonal() * back.transpose();
}

}  // namespace

// Of the first evaluation of a step, which has left M^-1 W in the work space.
bool PlainSteps::still(const Subset &subset) const {
    const kernel::Plan &plan = subset.plan;
    const int b = plan.kb + plan.mb, free = plan.k + plan.m + plan.nf;
    if (plan.m == 0 || b == 0) return false;
    using Matrix = Eigen::Map<const Eigen::MatrixXd>;
    const Matrix W(kernel::rows_of(&plan, const_cast<double *>(rows_.data())).W, free + b, plan.nv);
    const Matrix by_M(kernel::work_of(&plan).by_M, plan.nv, free + b);
    const Eigen::MatrixXd G = held(W * by_M, free, fixed_.ties.vanishes);
    const kernel::Table table = kernel::table_of(&plan);
    const int *first_F = kernel::index_of(&plan).first_F;
    for (int i = 0; i < plan.k; ++i) {
        const int first = plan.k + first_F[i], n = first_F[i + 1] - first_F[i];
        if (n == 0 || table.e[i] > 0.0) continue;
        const double own = G(i, i), largest = std::max(own, G.diagonal().segment(first, n).maxCoeff());
        if (!(own > IMMOBILE * largest)) continue;
        const Eigen::VectorXd by_normal = G.block(first, i, n, 1);
        const Eigen::MatrixXd rest = G.block(first, first, n, n) - by_normal * by_normal.transpose() / own;
        if (Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(rest, Eigen::EigenvaluesOnly).eigenvalues()[0] < IMMOBILE * largest)
            return true;
    }
    return false;
}

}  // namespace nga
