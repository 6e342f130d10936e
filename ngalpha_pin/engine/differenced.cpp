// Twin of step/differenced.py: a Newton correction with all derivatives by q, those of M and W by differences.
#include <Eigen/Dense>
#include <algorithm>

#include "plain_steps.hpp"

namespace nga {
namespace {

constexpr double SHIFT = 1e-7;   // of a coordinate, in parts of what the coordinates are or one: half of the digits
constexpr double RCOND = 1e-10;  // singular values below this are left out, see newton_matrix.py

using Table = Eigen::Map<Eigen::MatrixXd>;
using Column = Eigen::Map<Eigen::VectorXd>;

}  // namespace

// Derivatives of R and of y by Q at the last evaluation, which is made again behind them.
void PlainSteps::shift(Subset &subset, const Loads &loads, const Moment &moment, Eigen::MatrixXd &R_Q, Eigen::MatrixXd &y_Q) {
    const kernel::Plan &plan = subset.plan;
    const int nv = plan.nv, n = static_cast<int>(y_Q.rows());
    const std::vector<double> start = iterate_;
    const kernel::Rows rows = kernel::rows_of(&plan, rows_.data());
    const Eigen::VectorXd R = Column(rows.R, 3 * nv), y = Column(rows.y, n);
    const double h = SHIFT * std::max(1.0, dq_.cwiseAbs().maxCoeff());
    for (int i = 0; i < nv; ++i) {
        iterate_ = start;
        kernel::iterate_of(&plan, iterate_.data()).x[2 * nv + i] += h;
        kernel::nga_move(&plan, step_.data(), iterate_.data());
        evaluate(subset, loads, moment);
        const kernel::Rows shifted = kernel::rows_of(&plan, rows_.data());
        R_Q.col(i) = (Column(shifted.R, 3 * nv) - R) / h, y_Q.col(i) = (Column(shifted.y, n) - y) / h;
    }
    iterate_ = start;
    evaluate(subset, loads, moment);
}

bool PlainSteps::correct_by_differences(Subset &subset, const Loads &loads, const Moment &moment) {
    const kernel::Plan &plan = subset.plan;
    const int nv = plan.nv, n = plan.k + 2 * (plan.k + plan.m + plan.nf + plan.kb + plan.mb) + plan.kb;
    const int l = plan.k + plan.m + plan.nf + plan.kb + plan.mb;
    Eigen::MatrixXd R_Q(3 * nv, nv), y_Q(n, nv);
    shift(subset, loads, moment, R_Q, y_Q);
    if (!fixed_.flat) mechanism_.d_integrate(moment.q, dq_, kernel::work_of(&plan).T);
    kernel::nga_linearise(&plan, step_.data(), rows_.data());
    const kernel::Step step = kernel::step_of(&plan, step_.data());
    const kernel::Rows rows = kernel::rows_of(&plan, rows_.data());
    const kernel::Work work = kernel::work_of(&plan);
    const kernel::Index at = kernel::index_of(&plan);
    const double gamma_c = step.gamma_c[0], beta_c = step.beta_c[0];
    Eigen::MatrixXd M(nv, nv);
    kernel::copy_matrix(&live_.M, nv, M.data());
    M.triangularView<Eigen::StrictlyLower>() = M.transpose();
    const Table D(work.D, nv, nv), W(rows.W, l, nv), E(work.E, l, n), Y(work.Y, l, nv);

    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3 * nv, 3 * nv), right = Eigen::MatrixXd::Zero(3 * nv, n + 1);
    J.leftCols(nv) = beta_c * R_Q;
    J.topLeftCorner(nv, nv) += M + gamma_c * D;
    J.block(2 * nv, 0, nv, nv) -= beta_c * M;  // that of Q itself
    J.block(0, nv, nv, nv) = D, J.block(nv, nv, nv, nv) = M;
    J.rightCols(nv) = R_Q;
    for (int u = 0; u < l; ++u)
        right.col(at.at_a[u]).head(nv) = W.row(u), right.col(at.at_v[u]).segment(nv, nv) = W.row(u);
    if (l) right.bottomLeftCorner(nv, n) = W.transpose() * E;
    right.col(n) = -Column(rows.R, 3 * nv);
    Table Z(work.Z, 3 * nv, n + 1), H(work.H, n, n + 1);
    Z = J.partialPivLu().solve(right);
    const Eigen::MatrixXd da = Z.topRows(nv), dv = gamma_c * da + Z.middleRows(nv, nv);
    H = y_Q * (beta_c * da + Z.bottomRows(nv));
    const Eigen::MatrixXd rates = W * dv, accelerations = W * da + Y * dv;
    for (int u = 0; u < l; ++u) H.row(at.at_v[u]) += rates.row(u), H.row(at.at_a[u]) += accelerations.row(u);
    next_.assign(subset.iterate, 0.0);
    ++corrections;
    if (kernel::nga_solve(&plan, step_.data(), iterate_.data(), rows_.data(), next_.data())) {
        const Table A(work.A, n, n);
        if (!A.allFinite()) return false;
        Eigen::JacobiSVD<Eigen::MatrixXd, Eigen::NoQRPreconditioner> values(A, Eigen::ComputeThinU | Eigen::ComputeThinV);
        values.setThreshold(RCOND);
        Column(work.y, n) = values.solve(Column(work.b, n));
        kernel::nga_advance(&plan, step_.data(), iterate_.data(), next_.data());
    }
    iterate_.swap(next_);
    return true;
}

}  // namespace nga
