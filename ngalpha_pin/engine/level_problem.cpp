#include "level_problem.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernel/kernel.hpp"
#include "tolerances.hpp"

namespace nga {
namespace {

// see the file of the same names in Python for what they mean
constexpr double CONE = 1e-9, DIVERGES = 1e6, REGULAR = 1e-10;
constexpr int BEFORE_NEWTON = 20, AGAIN = 4, HELD_STEPS = 20, FREE_STEPS = 6, FEW_STEPS = 2;
constexpr double PER_ROW = 0.5, NEWTON_TOL = 1e-13;
constexpr double FIRST = 0.1, LEAST = 1e-9, MOST = 1e2, FALLS = 10.0, SLOWLY = 2.0, ROUGHLY = 100.0, ROUNDED = 1e-10;
constexpr int ROUNDS = 40, PATIENT_ROUNDS = 200, STALLS = 8;

bool finite(const Eigen::VectorXd &x) { return x.array().isFinite().all(); }

}  // namespace

LevelProblem::LevelProblem(Eigen::MatrixXd G, Vector b, Vector mu, std::vector<int> of_F, Vector lower, Vector upper)
    : G_(std::move(G)), b_(std::move(b)), mu_(std::move(mu)), lower_(std::move(lower)), upper_(std::move(upper)),
      of_F_(std::move(of_F)) {
    k_ = static_cast<int>(mu_.size()), j_ = k_ + static_cast<int>(of_F_.size()), n_ = static_cast<int>(b_.size());
    diagonal_ = G_.diagonal().cwiseMax(TINY);
    Vector size = Vector::Constant(k_, TINY);
    for (int f = k_; f < j_; ++f) size[of_F_[f - k_]] = std::max(size[of_F_[f - k_]], diagonal_[f]);
    scale_ = diagonal_;
    for (int f = k_; f < j_; ++f) scale_[f] = size[of_F_[f - k_]];
    root_ = scale_.cwiseSqrt();
    for (int i = 0; i <= k_; ++i)
        first_F_.push_back(k_ + static_cast<int>(std::lower_bound(of_F_.begin(), of_F_.end(), i) - of_F_.begin()));
    for (int c = 0; c < n_; ++c) {
        starts_.push_back(static_cast<int>(rows_.size()));
        for (int r = 0; r < n_; ++r)
            if (G_(r, c) != 0.0) rows_.push_back(r), values_.push_back(G_(r, c));
    }
    starts_.push_back(static_cast<int>(rows_.size()));
    state_.assign(3, 0.0);
}

std::pair<LevelProblem::End, int> LevelProblem::solve(Vector &P, double tol, int max_sweeps, bool patient) {
    int newton_at = std::max(BEFORE_NEWTON, static_cast<int>(PER_ROW * n_));
    y_ = b_ + G_ * P;
    while (true) {
        const int found = sweep(P, std::min(newton_at, max_sweeps), tol), count = static_cast<int>(state_[0]);
        if (found != 0) return {found > 0 ? End::converged : End::open, count};
        if (count == newton_at) {
            Vector x = P;
            const End end = proximal_newton(x, std::max(tol, NEWTON_TOL), patient);
            if (end == End::convex) return {end, count};
            y_ += G_ * (x - P), P = x;
            if (end == End::converged) return {end, count};
        }
        if (count >= max_sweeps) return {End::open, count};
        newton_at *= newton_at < max_sweeps / AGAIN ? AGAIN : 2;
    }
}

int LevelProblem::sweep(Vector &P, int last, double tol) {
    const int sizes[4] = {k_, j_, n_, last};
    const double limits[2] = {tol, DIVERGES};
    return kernel::nga_sweep(sizes, first_F_.data(), starts_.data(), rows_.data(), values_.data(), diagonal_.data(),
                             mu_.data(), lower_.data(), upper_.data(), limits, state_.data(), P.data(), y_.data());
}

LevelProblem::End LevelProblem::proximal_newton(Vector &P, double tol, bool patient) {
    int steps = 0;
    Vector found = P;
    if (newton(found, P, 0.0, tol, steps)) {
        P = found;
        return End::converged;
    }
    if (convex()) return End::convex;
    Vector best = found, centre = P;
    double nearest = laws(found, found, 0.0).error, rho = FIRST, falls = FALLS, last = MOST, halved = nearest;
    for (int i = 0, at = 0; i < (patient ? PATIENT_ROUNDS : ROUNDS); ++i) {
        found = centre;
        const bool solved = newton(found, centre, rho, tol, steps);
        const double error = laws(found, found, 0.0).error;
        if (!patient && std::min(error, nearest) <= ROUGHLY * tol && (!solved || error > 0.5 * nearest)) {
            P = error < nearest ? found : best;
            return End::converged;
        }
        if (error < nearest) best = found, nearest = error;
        if (nearest < 0.5 * halved)
            halved = nearest, at = i;
        else if (i - at >= STALLS && (!patient || nearest <= std::max(ROUGHLY * tol, ROUNDED)))
            break;
        if (!solved) {
            rho = std::min(std::max(std::sqrt(rho * last), SLOWLY * rho), MOST), falls = SLOWLY;
            continue;
        }
        centre = found, last = rho;
        if (error <= tol) {
            P = centre;
            return End::converged;
        }
        rho = std::max(rho / falls, LEAST);
        falls = steps <= FEW_STEPS ? falls * falls : std::min(SLOWLY * falls, FALLS);
    }
    P = best;
    return nearest <= ROUGHLY * tol ? End::converged : End::open;
}

// Semi-smooth Newton; where it does not converge P becomes what had the smallest residual.
bool LevelProblem::newton(Vector &P, const Vector &centre, double rho, double tol, int &steps) {
    Vector best = P, found, x = P;
    double nearest = std::numeric_limits<double>::infinity();
    std::map<std::string, std::pair<int, double>> seen;
    for (steps = 0; steps < (rho != 0.0 ? HELD_STEPS : FREE_STEPS); ++steps) {
        const Laws now = laws(x, centre, rho);
        if (now.error < nearest) best = x, nearest = now.error;
        if (now.error <= tol) {
            if (found.size()) {
                P = x;
                return true;
            }
            found = x;  // one more step: what a small residual leaves open where masses are very different
        } else if (found.size())
            break;
        const auto before = seen.find(now.sets());
        // sets that come back without a better residual come back again
        if (before != seen.end() && before->second.first < steps - 1 && now.error > 0.5 * before->second.second) break;
        seen[now.sets()] = {steps, now.error};
        x -= step(now);
        if (!finite(x)) break;
    }
    P = found.size() ? found : best;
    return found.size() > 0;
}

std::string LevelProblem::Laws::sets() const {
    return std::string(kinematic.begin(), kinematic.end()) + std::string(slips.begin(), slips.end());
}

LevelProblem::Laws LevelProblem::laws(const Vector &P, const Vector &centre, double rho) const {
    Laws found;
    found.rho = rho, found.R.resize(n_), found.unit = found.part = Vector::Zero(n_);
    found.kinematic.assign(n_, 0), found.slips.assign(n_, 0);
    const Vector y = b_ + G_ * P + (rho * scale_.array() * (P - centre).array()).matrix();
    const Vector scaled = (y.array() / ((1.0 + rho) * scale_.array())).matrix(), trial = P - scaled;
    for (int i = 0; i < k_; ++i) {
        found.kinematic[i] = trial[i] > 0.0;
        found.R[i] = found.kinematic[i] ? scaled[i] : P[i];
        const double radius = mu_[i] * std::max(P[i], 0.0);
        double squares = 0.0;
        for (int f = first_F_[i]; f < first_F_[i + 1]; ++f) squares += trial[f] * trial[f];
        const double norm = std::max(std::sqrt(squares), TINY);
        const bool slips = found.kinematic[i] && norm > (1.0 + CONE) * radius;
        for (int f = first_F_[i]; f < first_F_[i + 1]; ++f) {
            found.unit[f] = trial[f] / norm, found.part[f] = radius / norm;
            found.slips[f] = slips, found.kinematic[f] = found.kinematic[i] && !slips;
            found.R[f] = slips ? P[f] - radius * found.unit[f] : found.kinematic[f] ? scaled[f] : P[f];
        }
    }
    for (int i = j_; i < n_; ++i) {
        const double lower = lower_[i - j_], upper = upper_[i - j_];
        found.kinematic[i] = trial[i] >= lower && trial[i] <= upper;
        found.R[i] = found.kinematic[i] ? scaled[i] : P[i] - (trial[i] < lower ? lower : upper);
    }
    const double size = n_ ? std::max((P.array() * root_.array()).abs().maxCoeff(), TINY) : TINY;
    found.error = n_ ? (found.R.array() * root_.array()).abs().maxCoeff() / size : 0.0;
    return found;
}

// J^-1 R with J = A (G / scale + rho) / (1 + rho) + B.
Eigen::VectorXd LevelProblem::step(const Laws &laws) const {
    const double less = 1.0 / (1.0 + laws.rho), held = laws.rho / (1.0 + laws.rho);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(n_, n_);
    for (int i = 0; i < n_; ++i) {
        if (laws.slips[i]) continue;
        J(i, i) = laws.kinematic[i] ? REGULAR : 1.0;
        if (laws.kinematic[i]) J.row(i) += less / scale_[i] * G_.row(i), J(i, i) += held;
    }
    for (int f = k_; f < j_; ++f) {
        if (!laws.slips[f]) continue;
        const int contact = of_F_[f - k_];
        for (int g = first_F_[contact]; g < first_F_[contact + 1]; ++g) {
            const double turns = laws.part[f] * ((f == g) - laws.unit[f] * laws.unit[g]);
            J.row(f) += less * turns / scale_[g] * G_.row(g);
            J(f, g) += (f == g) - turns + held * turns;
        }
        J(f, contact) -= mu_[contact] * laws.unit[f];
    }
    Vector x = laws.R;
    std::vector<int> pivots(n_);
    if (kernel::factor_solve(n_, 1, J.data(), x.data(), pivots.data()) != 0)
        x.setConstant(std::numeric_limits<double>::quiet_NaN());
    return x;
}

bool LevelProblem::convex() const {
    return n_ == k_ && (G_ - G_.transpose()).cwiseAbs().maxCoeff() <= 1e-12 * scale_.maxCoeff();
}

}  // namespace nga
