#include "contact_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tree_operator.hpp"

namespace nga {
namespace {

// what keeps the Newton matrix regular among dependent directions, relative to the inverse masses; residuals stay exact
constexpr Held FREE{nullptr, 0.0, 1e-5};
constexpr double HELD_REGULAR = 1e-9;
// corrections that are tried, of a problem that is held as well, and how many may not halve the residual
constexpr int CORRECTIONS = 12, HELD_CORRECTIONS = 20, STALLS = 6;
constexpr int SWEEPS = 20;
// steps on the central path; gap at which Newton's method is tried first, part of it for the next time, and the last one
constexpr int PATH = 30;
constexpr double NEAR = 1e-3, NEARER = 1e-1, ENOUGH = 1e-11;
// proximal rounds: how much a problem is held, relative to the inverse masses, and the change of that
constexpr int ROUNDS = 120, TRY_FREE = 4;
constexpr double FIRST = 1e-4, LEAST = 1e-7, MOST = 1e2, FALLS = 10.0, SLOWLY = 2.0, RISES = 5.0;

}  // namespace

template <int N>
Measure ContactSolver<N>::linearise_all(const Vector &P, const Held &held) {
    trees_.evaluate(P, y_);
    const auto &groups = trees_.groups();
    Measure measure;
    for (std::size_t g = 0; g < groups.size(); ++g)
        linearise(groups[g], &P[groups[g].first], &y_[groups[g].first], held, responses_[g], measure);
    return measure;
}

// Semi-smooth Newton on the laws; P becomes what had the smallest residual.
template <int N>
bool ContactSolver<N>::newton(Vector &P, const Held &held, double tolerance, int corrections, Work &work) {
    double nearest = std::numeric_limits<double>::infinity();
    int stalled = 0;
    trial_ = P;
    for (int i = 0;; ++i) {
        const double error = linearise_all(trial_, held).error();
        stalled = error <= 0.5 * nearest ? 0 : stalled + 1;
        if (error < nearest) {
            nearest = error;
            P = trial_;
        }
        if (nearest <= tolerance) return true;
        if (i == corrections || stalled > STALLS || !std::isfinite(error)) return false;
        trees_.factorise(responses_);
        trees_.step(responses_, dP_, dy_);
        ++work.corrections;
        trial_ += dP_;
    }
}

// Gauss-Seidel prox sweeps, forwards and backwards in turn.
template <int N>
void ContactSolver<N>::sweep(Vector &P, int count, Work &work) {
    const auto &groups = trees_.groups();
    const int n = static_cast<int>(groups.size());
    trees_.evaluate(P, y_);
    for (int s = 0; s < count; ++s, ++work.sweeps)
        for (int l = 0; l < n; ++l) {
            const int g = s % 2 ? n - 1 - l : l, rows = groups[g].rows;
            double y[MOST_ROWS], to[MOST_ROWS], d[MOST_ROWS];
            double *own = &P[groups[g].first];
            trees_.local(g, own, y);
            std::copy(own, own + rows, to);
            prox_step(groups[g], trees_.own(g), y, to);
            bool moves = false;
            for (int i = 0; i < rows; ++i) {
                d[i] = to[i] - own[i];
                moves = moves || d[i] != 0.0;
                own[i] = to[i];
            }
            if (moves) trees_.change(g, d);
        }
}

// The central path from its beginning, with Newton's method on the laws from where it has got.
template <int N>
bool ContactSolver<N>::follow_path(const Problem &problem, Vector &P, double tolerance, Work &work) {
    interior_.start(problem);
    for (double near = NEAR; work.path < PATH && near > ENOUGH && interior_.advance(); ++work.path) {
        if (interior_.gap() > near) continue;
        near = NEARER * interior_.gap();
        P = near_ = interior_.percussions();
        if (newton(near_, FREE, tolerance, CORRECTIONS, work)) {
            P = near_;
            return true;
        }
    }
    return false;
}

// Proximal point method: problems that are held near the solution of the one before, by less and less.
template <int N>
bool ContactSolver<N>::proximal(Vector &P, double tolerance, Work &work) {
    double hold = FIRST, falls = FALLS;
    while (++work.rounds <= ROUNDS) {
        centre_ = near_ = P;
        if (!newton(near_, Held{centre_.data(), hold, HELD_REGULAR}, tolerance, HELD_CORRECTIONS, work)) {
            hold = std::min(RISES * hold, MOST);
            falls = std::max(SLOWLY, std::sqrt(falls));
            sweep(P, 2, work);
            continue;
        }
        P = near_;
        if (linearise_all(P, FREE).error() <= tolerance) return true;
        hold = std::max(hold / falls, LEAST);
        if (work.rounds % TRY_FREE == 0 && newton(near_, FREE, tolerance, CORRECTIONS, work)) {
            P = near_;
            return true;
        }
    }
    return false;
}

template <int N>
Work ContactSolver<N>::solve(const Problem &problem, Vector &P, double tolerance) {
    Work work;
    trees_.prepare(problem);
    responses_.resize(trees_.groups().size());
    y_.resize(P.size());
    dP_.resize(P.size());
    dy_.resize(P.size());
    const bool guessed = (P.array() != 0.0).any();
    work.solved = guessed && newton(P, FREE, tolerance, CORRECTIONS, work);
    if (!work.solved) {
        sweep(P, SWEEPS, work);
        work.solved = newton(P, FREE, tolerance, CORRECTIONS, work) ||
                      // what a guess leads to is near it, and the path begins at nothing
                      (guessed && proximal(P, tolerance, work)) || follow_path(problem, P, tolerance, work) ||
                      proximal(P, tolerance, work);
    }
    work.error = linearise_all(P, FREE).error();
    return work;
}

template class ContactSolver<6>;
template class ContactSolver<Eigen::Dynamic>;

}  // namespace nga
