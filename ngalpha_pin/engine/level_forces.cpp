// Twin of `forces_of_closed_contacts` and of `_forces` of step/linearised_round.py, whose constants are here.
#include "level_forces.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "tolerances.hpp"

namespace nga {
namespace {

using Numbers = Eigen::VectorXd;

constexpr double HELD_BACK = 0.98, STILL = 1e-8, STILL_ROUGHLY = 1e-4, DEPENDENT = 1e-10;
constexpr int HELD_ROUNDS = 4, RANKED = 150;

// Norms over the friction rows of each contact.
Numbers norms(const Level &level, const double *x) {
    Numbers squares = Numbers::Zero(level.mu.size());
    for (std::size_t f = 0; f < level.of_F.size(); ++f) squares[level.of_F[f]] += x[f] * x[f];
    return squares.cwiseSqrt();
}

// The rows that touch have independent directions.
bool independent(const Level &level, const std::vector<char> &touches) {
    const int k = static_cast<int>(level.mu.size());
    std::vector<int> rows;
    for (int i = 0; i < k; ++i)
        if (touches[i]) rows.push_back(i);
    for (std::size_t f = 0; f < level.of_F.size(); ++f)
        if (touches[level.of_F[f]]) rows.push_back(k + static_cast<int>(f));
    if (rows.size() > RANKED) return false;
    const int n = static_cast<int>(rows.size());
    Eigen::MatrixXd G(n, n);
    for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r)
            G(r, c) = level.G(rows[r], rows[c]) / (std::sqrt(std::max(level.G(rows[r], rows[r]), TINY)) *
                                                  std::sqrt(std::max(level.G(rows[c], rows[c]), TINY)));
    if (n == 0) return true;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> found(G, Eigen::EigenvaluesOnly);
    return (found.eigenvalues().array().abs() > DEPENDENT).all();
}

}  // namespace

Answer closed_forces(const Level &level, const std::vector<char> &closed, const Numbers &slip, const Numbers &guess,
                     double tol, int max_sweeps, bool patient) {
    const int k = static_cast<int>(level.mu.size()), m = static_cast<int>(level.of_F.size()), n = static_cast<int>(level.b.size());
    const Numbers speed = norms(level, slip.data());
    const auto slips = [&](int i) { return closed[i] && speed[i] > 0.0; };
    std::vector<int> free, of_free, place(k, -1), tied;
    std::vector<double> mu;
    for (int i = 0; i < k; ++i)
        if (closed[i]) place[i] = static_cast<int>(free.size()), free.push_back(i), mu.push_back(level.mu[i]);
    for (int f = 0; f < m; ++f) {
        const int i = level.of_F[f];
        if (slips(i)) tied.push_back(f);
        if (closed[i] && !slips(i)) free.push_back(k + f), of_free.push_back(place[i]);
    }
    std::vector<double> lower(level.lower.begin(), level.lower.end()), upper(level.upper.begin(), level.upper.end());
    for (int i = k + m; i < n; ++i) free.push_back(i);
    const int size = static_cast<int>(free.size());
    Eigen::MatrixXd G(size, size);
    Numbers b(size), la(size);
    for (int c = 0; c < size; ++c) {
        for (int r = 0; r < size; ++r) G(r, c) = level.G(free[r], free[c]);
        b[c] = level.b[free[c]], la[c] = guess.size() ? guess[free[c]] : 0.0;
    }
    // the friction of a slipping contact is tied to its normal force (120)
    std::vector<double> part;
    for (int f : tied) {
        const int i = level.of_F[f];
        part.push_back(-level.mu[i] * slip[f] / speed[i]);
        for (int r = 0; r < size; ++r) G(r, place[i]) += level.G(free[r], k + f) * part.back();
    }
    const auto as_vector = [](const std::vector<double> &x) { return Numbers(Eigen::Map<const Numbers>(x.data(), x.size())); };
    LevelProblem problem(std::move(G), b, as_vector(mu), of_free, as_vector(lower), as_vector(upper));
    Answer answer;
    answer.end = problem.solve(la, tol, max_sweeps, patient && tied.empty()).first;
    answer.P = Numbers::Zero(n);
    for (int i = 0; i < size; ++i) answer.P[free[i]] = la[i];
    for (std::size_t t = 0; t < tied.size(); ++t)
        answer.P[k + tied[t]] = part[t] * answer.P[level.of_F[tied[t]]];
    if (answer.end == LevelProblem::End::converged && !la.array().isFinite().all()) answer.end = LevelProblem::End::open;
    return answer;
}

Answer held_forces(Level level, const std::vector<char> &touches, const Numbers &slip, const Numbers &guess,
                   std::vector<char> slips, double tol, int max_sweeps, bool patient) {
    const int k = static_cast<int>(level.mu.size());
    const Numbers mu = level.mu, given = norms(level, slip.data());
    for (int i = 0; i < k; ++i) slips[i] = slips[i] || given[i] > 0.0;
    const bool all = std::all_of(slips.begin(), slips.end(), [](char x) { return x != 0; });
    if (!all && independent(level, touches)) slips.assign(k, 1);
    const double largest = std::max(level.b.size() ? level.b.cwiseAbs().maxCoeff() : 0.0, TINY);
    Answer answer;
    answer.P = guess;
    for (int round = 0; round < HELD_ROUNDS; ++round) {
        for (int i = 0; i < k; ++i) level.mu[i] = slips[i] ? mu[i] : HELD_BACK * mu[i];
        answer = closed_forces(level, touches, slip, answer.P, tol, max_sweeps, patient);
        if (answer.end == LevelProblem::End::convex) return answer;
        const Numbers y = level.b + level.G * answer.P, speed = norms(level, y.data() + k);
        const double still = answer.end == LevelProblem::End::converged ? STILL : STILL_ROUGHLY;
        bool again = false;
        std::vector<char> moves(k);
        for (int i = 0; i < k; ++i) {
            moves[i] = touches[i] && answer.P[i] > 0.0 && speed[i] > still * largest;
            again = again || (moves[i] && !slips[i] && mu[i] > 0.0);
        }
        if (!again) break;
        for (int i = 0; i < k; ++i) slips[i] = slips[i] || moves[i];
    }
    return answer;
}

}  // namespace nga
