// The contact problems of a crowd: gaps, velocities and accelerations of the linearised step, one after the other.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "crowd.hpp"
#include "tolerances.hpp"

namespace nga {
namespace {

// see common/tolerances.py
constexpr double CONE = 1e-9, STILL = 1e-8;
// part of the tolerance of the step that a problem may leave where the result counts as it is
constexpr double LEFT = 0.1;
// friction that is held back at first, how often more contacts may turn out to slip with that, and the slip velocity
// that is none, in parts of the largest velocity, where the problem is not solved (`STILL` where it is)
constexpr double HELD_BACK = 0.98, STILL_ROUGHLY = 1e-4;
constexpr int HELD_ROUNDS = 4;

using Mask = std::vector<char>;

}  // namespace

Crowd::Level Crowd::level(const Subset &subset, bool held, const double *y, const Vector &P) const {
    const auto &by_A = held ? by_held_ : by_M_;
    return {held ? &held_ : &M_, &by_A, Eigen::Map<const Vector>(y, P.size()) - across(by_A, subset, P), P};
}

// The groups and legs of contacts that touch, without their laws.
Problem Crowd::problem_of(const Subset &subset, const Level &at, const Mask &touches) const {
    Problem problem;
    for (int t = 0; t < forest_.count(); ++t) {
        const Matrix &A = (*at.A)[t];
        problem.sizes.push_back(static_cast<int>(A.rows()));
        problem.M.insert(problem.M.end(), A.data(), A.data() + A.size());  // symmetric
    }
    std::vector<int> group(subset.plan.k, -1);
    for (int i = 0; i < subset.plan.k; ++i) {
        if (!touches[i]) continue;
        group[i] = static_cast<int>(problem.groups.size());
        Group added;
        added.first = static_cast<int>(problem.bias.size()), added.rows = subset.contact_rows(i);
        for (int e = 0; e < added.rows; ++e) problem.bias.push_back(at.b[subset.row(i, e)]);
        problem.groups.push_back(added);
    }
    for (const Leg &leg : subset.legs) {
        if (group[leg.group] < 0) continue;
        const auto W = part(W_, subset, leg);
        problem.legs.push_back({group[leg.group], leg.tree, static_cast<int>(problem.J.size())});
        problem.J.insert(problem.J.end(), W.data(), W.data() + W.size());
    }
    return problem;
}

// P is the first guess, then zero where contacts do not touch.
bool Crowd::solve(Problem &problem, const Subset &subset, const Mask &touches, Vector &P, double tolerance) {
    Vector x(problem.bias.size());
    int at = 0;
    for (int i = 0; i < subset.plan.k; ++i)
        for (int e = 0; touches[i] && e < subset.contact_rows(i); ++e) x[at++] = P[subset.row(i, e)];
    bool solved = true;
    if (at > 0) {
        const bool bodies = std::all_of(problem.sizes.begin(), problem.sizes.end(), [](int n) { return n == 6; });
        const Work work = bodies ? bodies_.solve(problem, x, tolerance) : trees_.solve(problem, x, tolerance);
        ++problems, inner += work.corrections, solved = work.solved;
    }
    P.setZero(), at = 0;
    for (int i = 0; i < subset.plan.k; ++i)
        for (int e = 0; touches[i] && e < subset.contact_rows(i); ++e) P[subset.row(i, e)] = x[at++];
    return solved;
}

Vector Crowd::slip_of(const Subset &subset, const Level &at, const Vector &P) const {
    return at.b + across(*at.by_A, subset, P);
}

// Contacts that slip, or start to, by more than a part of the largest velocity.
Mask Crowd::moves(const Subset &subset, const Level &at, const Vector &P, double still) const {
    const double least = still * std::max(at.b.cwiseAbs().maxCoeff(), TINY);
    const Vector y = slip_of(subset, at, P);
    Mask found(subset.plan.k);
    for (int i = 0; i < subset.plan.k; ++i) {
        double squares = 0.0;
        for (int e = 1; e < subset.contact_rows(i); ++e) squares += y[subset.row(i, e)] * y[subset.row(i, e)];
        found[i] = std::sqrt(squares) > least;
    }
    return found;
}

// Percussions from velocities, or forces from accelerations with friction against a slip that is given.
//
// Where directions are dependent, a solution may be at the edge of the friction cones although forces inside of them do
// as well, and rounding would decide between stick and slip. With a little less friction such contacts end inside; those
// that slip with that, or are known to have slipped, get all of it. All do where index sets are not asked for.
Vector Crowd::forces(const Subset &subset, const Level &at, const Mask &touches, Mask slips, const Vector *slip,
                     double tolerance) {
    const int k = subset.plan.k;
    const double *mu = kernel::table_of(&subset.plan).mu;
    Problem problem = problem_of(subset, at, touches);
    for (int i = 0, g = 0; i < k; ++i) {
        double squares = 0.0;
        for (int e = 1; slip != nullptr && e < subset.contact_rows(i); ++e)
            squares += (*slip)[subset.row(i, e)] * (*slip)[subset.row(i, e)];
        const double speed = std::sqrt(squares);
        slips[i] = slips[i] || speed > 0.0;
        if (!touches[i]) continue;
        Group &group = problem.groups[g++];
        if (!(speed > 0.0)) continue;
        group.kind = Kind::tied;
        for (int e = 1; e < group.rows; ++e) group.direction[e - 1] = -(*slip)[subset.row(i, e)] / speed;
    }
    Vector P = at.guess;
    for (int round = 0; round < HELD_ROUNDS; ++round) {
        for (int i = 0, g = 0; i < k; ++i)
            if (touches[i]) problem.groups[g++].mu = slips[i] ? mu[i] : HELD_BACK * mu[i];
        const bool solved = solve(problem, subset, touches, P, tolerance);
        if (std::all_of(slips.begin(), slips.end(), [](char x) { return x; })) break;
        const Mask found = moves(subset, at, P, solved ? STILL : STILL_ROUGHLY);
        bool more = false;
        for (int i = 0; i < k; ++i) {
            if (!touches[i] || !(P[i] > 0.0) || !found[i] || slips[i]) continue;
            slips[i] = 1, more = more || mu[i] > 0.0;
        }
        if (!more) break;
    }
    return P;
}

// kappa_hat with friction that is a share of it (128).
Vector Crowd::gap_forces(const Subset &subset, const kernel::Step &s, const Vector &gaps, const Vector &kappa,
                         const Vector &share) {
    const Mask every(subset.plan.k, 1);
    const Level at{&M_, &by_M_, gaps, kappa};
    Problem problem = problem_of(subset, at, every);
    for (int i = 0; i < subset.plan.k; ++i) {
        Group &group = problem.groups[i];
        group.kind = Kind::tied, group.mu = 1.0;
        for (int e = 1; e < group.rows; ++e) group.direction[e - 1] = share[subset.row(i, e)];
    }
    Vector P = kappa;
    solve(problem, subset, every, P, LEFT * s.tol[0]);
    return P;
}

void Crowd::round(int number, double *step, double *iterate, double *rows, double *next, double *sets) {
    ++rounds;
    const Subset &subset = *subsets_.at(number);
    const kernel::Plan &plan = subset.plan;
    const int nv = plan.nv, k = plan.k, m = plan.m, j = k + m;
    const kernel::Step s = kernel::step_of(&plan, step);
    const kernel::Iterate it = kernel::iterate_of(&plan, iterate);
    const kernel::Rows r = kernel::rows_of(&plan, rows);
    // what the residuals of a, U and Q do to gaps, velocities and accelerations
    const Vector y = Eigen::Map<const Vector>(r.y, k + 2 * j) + response(number, step, rows);
    for (int t = 0; loaded_ && t < forest_.count(); ++t)  // all of S but gyroscopic terms
        held_[t] = 0.5 * (S_[t] + S_[t].transpose()), by_held_[t] = held_[t].inverse();
    const bool displaces = s.displaces[0] != 0.0, paper = s.paper[0] != 0.0, whole = s.slackened[0] != 0.0;
    const double tolerance = LEFT * s.tol[0];
    const auto on_cone = [&](const Vector &P, int i) {
        double squares = 0.0;
        for (int e = 1; e < subset.contact_rows(i); ++e) squares += P[subset.row(i, e)] * P[subset.row(i, e)];
        return std::sqrt(squares) >= kernel::table_of(&plan).mu[i] * P[i] * (1.0 - CONE);
    };
    Vector kappa(j), P = Eigen::Map<const Vector>(it.z + k, j), la = Eigen::Map<const Vector>(it.x + 3 * nv + k + j, j);
    Mask slipped(k), slipped_a(k), touches(k), closed(k);
    for (int i = 0; i < k; ++i) {
        kappa[i] = it.z[i];
        const double ratio = displaces && !paper && !kernel::has_carried(&s, i) ? r.ratio[i] : 0.0;
        for (int e = 1; e < subset.contact_rows(i); ++e) kappa[subset.row(i, e)] = ratio * P[subset.row(i, e)];
        slipped[i] = whole || (P[i] > 0.0 && on_cone(P, i));
        slipped_a[i] = whole || (la[i] > 0.0 && on_cone(la, i));
    }
    const Level velocities = level(subset, loaded_, y.data() + k, P);
    Vector gaps = Vector::Zero(j), share = Vector::Zero(j), P_c, slip = Vector::Zero(j);
    gaps.head(k) = y.head(k);
    gaps -= across(by_M_, subset, kappa);
    // friction shifts the gaps, and only contacts that close have friction
    for (int again = 0; again < (displaces ? 2 : 1); ++again) {
        if (displaces) {
            const bool any = (kappa.head(k).array() != 0.0).any();
            for (int i = 0; i < k; ++i) touches[i] = any ? kappa[i] > 0.0 : gaps[i] <= 0.0;
            P_c = forces(subset, velocities, touches, slipped, nullptr, tolerance);  // (131), (137)
            for (int i = 0; i < k && !paper; ++i)
                for (int e = 1; e < subset.contact_rows(i); ++e)
                    share[subset.row(i, e)] =
                        P_c[i] > 0.0 && !kernel::has_carried(&s, i) ? P_c[subset.row(i, e)] / P_c[i] : 0.0;
        }
        kappa = gap_forces(subset, s, gaps, kappa, share);
    }
    const Vector left = gaps + across(by_M_, subset, kappa);
    for (int i = 0; i < k; ++i)  // of the corners of a face some carry it, and the others touch as well
        touches[i] = kappa[i] > 0.0 || (whole && left[i] <= 1.0 / s.kinematic[i]);
    if (!displaces) P_c = forces(subset, velocities, touches, slipped, nullptr, tolerance);
    const Vector rates = slip_of(subset, velocities, P_c);
    Mask accelerates(k), edge(k), edge_a(k);
    for (int i = 0; i < k; ++i) {
        closed[i] = P_c[i] > 0.0, edge[i] = closed[i] && on_cone(P_c, i);
        accelerates[i] = closed[i] && s.accelerates[0] != 0.0;
        for (int e = 1; edge[i] && e < subset.contact_rows(i); ++e) slip[subset.row(i, e)] = rates[subset.row(i, e)];
    }
    Vector la_c = Vector::Zero(j);
    Mask moving = moves(subset, velocities, P_c, STILL), moving_a(k, 0);
    if (s.accelerates[0] != 0.0) {  // (134), (140)
        const Level at = level(subset, loaded_, y.data() + k + j, la);
        la_c = forces(subset, at, accelerates, slipped_a, &slip, tolerance);
        moving_a = moves(subset, at, la_c, STILL);
    }
    for (int i = 0; i < k; ++i) {
        const bool pulls = la_c[i] > 0.0, stick = closed[i] && !(edge[i] && moving[i]);
        sets[i] = touches[i] || closed[i], sets[k + i] = closed[i], sets[2 * k + i] = pulls, sets[3 * k + i] = stick;
        sets[4 * k + i] = stick && pulls && !(on_cone(la_c, i) && moving_a[i]);
    }
    with_forces(number, step, iterate, rows, kappa, P_c, la_c, next);
}

// S and its derivatives are those of the last call of `response`.
void Crowd::with_forces(int number, double *step, double *iterate, double *rows, const Vector &kappa, const Vector &P,
                        const Vector &la, double *next) {
    const Subset &subset = *subsets_.at(number);
    const kernel::Plan &plan = subset.plan;
    const int nv = plan.nv, k = plan.k, j = k + plan.m;
    const kernel::Step s = kernel::step_of(&plan, step);
    const kernel::Iterate it = kernel::iterate_of(&plan, iterate);
    kernel::Iterate to = kernel::iterate_of(&plan, next);
    const kernel::Rows r = kernel::rows_of(&plan, rows);
    double *multipliers = to.x + 3 * nv;
    for (int u = 0; u < j; ++u) {
        multipliers[k + j + u] = la[u];
        multipliers[k + u] = P[u] - s.gamma_c[0] * la[u] - s.z_known[k + u];
    }
    for (int i = 0; i < k; ++i) {
        const bool half = s.paper[0] == 0.0 && kernel::has_carried(&s, i);
        const double known = half ? s.dt[0] / 2 * s.z_known[k + i] : s.z_known[i];
        multipliers[i] = kappa[i] - known - kernel::kappa_c(&s, i) * la[i];
    }
    std::vector<double> ratio(k), shares(plan.m, 0.0);
    kernel::Rows of_laws = r;
    of_laws.ratio = ratio.data(), of_laws.share = shares.data();
    Vector moved = Eigen::Map<const Vector>(multipliers, j);
    kernel::find_forces(&plan, &s, &to, &of_laws, moved.data() + k);
    Eigen::Map<const Vector> La(multipliers + k, j), old(it.x + 3 * nv + k + j, j);
    Eigen::Map<const Vector> a(it.x, nv), U_old(it.x + nv, nv), Q_old(it.x + 2 * nv, nv), R_a(r.R, nv);
    const Vector U = by(by_M_, collect(subset, La)), Q = by(by_M_, collect(subset, moved));
    const Vector rest = R_a + collect(subset, old - la) + by(D_, U - U_old) + by(KT_, Q - Q_old);
    Eigen::Map<Vector>(to.x, nv) = a - by(by_S_, rest);
    Eigen::Map<Vector>(to.x + nv, nv) = U, Eigen::Map<Vector>(to.x + 2 * nv, nv) = Q;
    kernel::nga_move(&plan, step, next);
}

}  // namespace nga
