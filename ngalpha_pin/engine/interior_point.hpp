// Interior-point method on a contact problem: from nothing to the neighbourhood of a solution.
//
// The normal law is complementarity of two numbers; Coulomb's law, with the speed psi of the slip as an unknown, is
// complementarity of (mu P_N, P_F) and (psi, y_F) on second-order cones: their Jordan product vanishes where friction of
// that size is against the slip. Mehrotra's predictor and corrector, with the scaling of Nesterov and Todd, follow the
// central path. Among dependent directions it ends in the middle of all solutions, where index sets are told apart.
#pragma once
#include <cmath>
#include <limits>
#include <vector>

#include "cone.hpp"
#include "contact_problem.hpp"
#include "tolerances.hpp"

namespace nga {

template <int N>
class InteriorPoint {
public:
    explicit InteriorPoint(TreeOperator<N> &trees) : trees_(trees) {}

    // Begin in the middle of the cones.
    void start(const Problem &problem);

    // One step along the central path; false where it leads no further.
    bool advance();

    // Mean product of percussion and velocity, and largest residual of y, in units of those at the start.
    double gap() const { return gap_; }
    double residual() const { return residual_; }
    const Vector &percussions() const { return P_; }

private:
    // Numbers x and z >= 0 whose product vanishes.
    struct Scalar {
        double x = 1.0, z = 1.0, dx = 0.0, dz = 0.0;
        bool exists = false;
    };
    // A group, with percussions in units of `unit_` / sqrt(s) and velocities in units of `unit_` sqrt(s). The normal row,
    // or distances from the lower and from the upper bound; and the cone of friction.
    struct Pair {
        Scalar normal, upper;
        double root_N, root_F, left_N = 0.0, left_F[MOST_ROWS];  // left: y - z
        int n = 0;                                               // dimension of the cone
        ConePoint x, z, dx, dz, q;
        Scaling scaling;
    };
    // what the products of x and z shall be, and whether they are corrected for the step found before
    struct Target {
        double product;
        bool corrects;
        double of(const Scalar &s) const { return product - (corrects ? s.dx * s.dz : 0.0); }
    };

    void start(Pair &pair, const Group &group);
    void measure();
    void respond(Pair &pair, const Group &group, const double *P, const double *y, Target target, Response &out);
    void respond_friction(Pair &pair, const Group &group, Target target, Response &out);
    void respond_bounded(const Pair &pair, const Group &group, double P, double y, Target target, Response &out);
    void find_directions(Target target);
    void direction(Pair &pair, const Group &group, const double *dP, const double *dy, Target target);
    double longest() const;

    TreeOperator<N> &trees_;
    std::vector<Pair> pairs_;
    std::vector<Response> responses_;
    Vector P_, y_, dP_, dy_;
    double unit_ = 1.0, gap_ = 1.0, residual_ = 1.0;
    int products_ = 0;
    double rest_ = 0.0;  // compliance of a percussion towards where it is
};

// part of the way to the edge of the cones, and step at which the path has ended
constexpr double INSIDE = 0.99, STUCK = 1e-4;
// compliance that keeps dependent directions regular, in parts of the inverse masses: least, and in parts of the gap
constexpr double REST = 1e-8, REST_OF_GAP = 1e-2;
constexpr double BILATERAL = 1e-7;  // the same of rows without bounds
constexpr int REFINEMENTS = 1;      // of a step: what the factors lose where percussions are stiff

template <int N>
void InteriorPoint<N>::start(const Problem &problem) {
    const auto &groups = trees_.groups();
    unit_ = TINY;
    for (const Group &group : groups)
        for (int i = 0; i < group.rows; ++i)
            unit_ = std::max(unit_, std::abs(problem.bias[group.first + i]) / std::sqrt(i ? group.s_F : group.s_N));
    pairs_.assign(groups.size(), Pair());
    responses_.resize(groups.size());
    P_.setZero(problem.bias.size());
    y_ = dP_ = dy_ = P_;
    products_ = 0;
    for (std::size_t g = 0; g < groups.size(); ++g) start(pairs_[g], groups[g]);
    measure();
}

template <int N>
void InteriorPoint<N>::start(Pair &pair, const Group &group) {
    double *P = &P_[group.first];
    pair.root_N = std::sqrt(group.s_N);
    pair.root_F = std::sqrt(group.s_F);
    const double one = unit_ / pair.root_N;
    if (group.kind == Kind::bounded) {
        const bool below = std::isfinite(group.lower), above = std::isfinite(group.upper);
        P[0] = below && above ? (group.lower + group.upper) / 2
                              : std::min(std::max(0.0, group.lower + one), group.upper - one);
        pair.normal.exists = below && group.upper > group.lower;
        pair.upper.exists = above && group.upper > group.lower;
        pair.normal.x = (P[0] - group.lower) / one;
        pair.upper.x = (group.upper - P[0]) / one;
        for (Scalar *s : {&pair.normal, &pair.upper}) s->z = s->exists ? std::max(1.0, 1.0 / s->x) : 0.0;
        products_ += pair.normal.exists + pair.upper.exists;
        return;
    }
    pair.normal.exists = true;
    P[0] = one;
    ++products_;
    if (group.kind == Kind::tied)
        for (int i = 1; i < group.rows; ++i) P[i] = group.mu * group.direction[i - 1] * P[0];
    if (group.kind == Kind::tied || group.mu <= 0.0 || group.rows == 1) return;
    pair.n = group.rows;
    pair.x.x[0] = group.mu * P[0] * pair.root_F / unit_;
    pair.z.x[0] = 1.0 / pair.x.x[0];
    ++products_;
}

// y, what is left of it, and the gap
template <int N>
void InteriorPoint<N>::measure() {
    trees_.evaluate(P_, y_);
    const auto &groups = trees_.groups();
    double sum = 0.0;
    residual_ = 0.0;
    for (std::size_t g = 0; g < groups.size(); ++g) {
        Pair &pair = pairs_[g];
        const double *y = &y_[groups[g].first];
        for (const Scalar *s : {&pair.normal, &pair.upper})
            if (s->exists) sum += s->x * s->z;
        if (groups[g].kind == Kind::bounded) continue;  // found anew in each step
        pair.left_N = y[0] / (pair.root_N * unit_) - pair.normal.z;
        residual_ = std::max(residual_, std::abs(pair.left_N));
        sum += pair.x.dot(pair.z, pair.n);
        for (int i = 1; i < pair.n; ++i) {
            pair.left_F[i] = y[i] / (pair.root_F * unit_) - pair.z.x[i];
            residual_ = std::max(residual_, std::abs(pair.left_F[i]));
        }
    }
    gap_ = sum / std::max(products_, 1);
}

template <int N>
void InteriorPoint<N>::respond_bounded(const Pair &pair, const Group &group, double P, double y, Target target,
                                       Response &out) {
    if (group.upper <= group.lower) {
        out.p[0] = group.lower - P;
        return;
    }
    double stiffness = BILATERAL, force = -y / (pair.root_N * unit_);
    if (pair.normal.exists) {
        stiffness += pair.normal.z / pair.normal.x;
        force += target.of(pair.normal) / pair.normal.x;
    }
    if (pair.upper.exists) {
        stiffness += pair.upper.z / pair.upper.x;
        force -= target.of(pair.upper) / pair.upper.x;
    }
    out.p[0] = force / stiffness * (unit_ / pair.root_N);
    out.C[0][0] = 1.0 / (stiffness * group.s_N);
}

// dx = W q - W^2 dz with dz_0 = dpsi eliminated: psi is whatever the size mu P_N of friction asks for
template <int N>
void InteriorPoint<N>::respond_friction(Pair &pair, const Group &group, Target target, Response &out) {
    const int n = pair.n;
    const Scaling &s = pair.scaling;
    ConePoint right;
    if (target.corrects) right = product(s.times(s.inverse, pair.dx), s.times(s.W, pair.dz), n);
    const ConePoint own = product(s.lambda, s.lambda, n);
    for (int i = 0; i < n; ++i) right.x[i] = (i ? 0.0 : target.product) - own.x[i] - right.x[i];
    pair.q = s.times(s.W, quotient(s.lambda, right, n));
    // what is left on the tangents: S = across (1 - n n^T) + along n n^T with W^2 = across (2 w w^T - diag(1, -1 ..))
    const double across = s.square_size, stretch = 2.0 * s.w[0] * s.w[0] - 1.0, along = across / stretch;
    double tail = 0.0;
    for (int i = 1; i < n; ++i) tail += s.w[i] * s.w[i];
    const double soft_across = across / (1.0 + rest_ * across), soft_along = along / (1.0 + rest_ * along);
    const double dx_0 = group.mu * out.p[0] * pair.root_F / unit_;
    double p[MOST_ROWS], turn[MOST_ROWS], p_along = 0.0, turn_along = 0.0;
    for (int i = 1; i < n; ++i) {
        turn[i] = 2.0 * s.w[0] * s.w[i] / stretch;
        p[i] = pair.q.x[i] - turn[i] * (pair.q.x[0] - dx_0);
        p_along += p[i] * s.w[i];
        turn_along += turn[i] * s.w[i];
    }
    auto soften = [&](double value, double value_along, int i) {  // (1 + rest S)^-1
        const double parallel = tail > 0.0 ? value_along * s.w[i] / tail : 0.0;
        return (value - parallel) / (1.0 + rest_ * across) + parallel / (1.0 + rest_ * along);
    };
    double left_along = 0.0;
    for (int i = 1; i < n; ++i) left_along += pair.left_F[i] * s.w[i];
    for (int i = 1; i < n; ++i) {
        const double parallel = tail > 0.0 ? left_along * s.w[i] / tail : 0.0;
        const double back = soft_across * (pair.left_F[i] - parallel) + soft_along * parallel;
        out.p[i] = (soften(p[i], p_along, i) - back) * unit_ / pair.root_F;
        out.C[i][0] = soften(turn[i], turn_along, i) * group.mu * out.C[0][0];
        for (int j = 1; j < n; ++j) {
            const double both = tail > 0.0 ? s.w[i] * s.w[j] / tail : 0.0;
            out.C[i][j] = (soft_across * ((i == j) - both) + soft_along * both) / group.s_F;
        }
    }
}

template <int N>
void InteriorPoint<N>::respond(Pair &pair, const Group &group, const double *P, const double *y, Target target,
                               Response &out) {
    out = Response{};
    if (group.kind == Kind::bounded) return respond_bounded(pair, group, P[0], y[0], target, out);
    const Scalar &normal = pair.normal;
    const double stiffness = normal.z / normal.x + rest_;
    out.p[0] = (target.of(normal) / normal.x - normal.z - pair.left_N) / stiffness * (unit_ / pair.root_N);
    out.C[0][0] = 1.0 / (stiffness * group.s_N);
    if (pair.n) return respond_friction(pair, group, target, out);
    for (int i = 1; i < group.rows; ++i) {
        const double c = group.kind == Kind::tied ? group.mu * group.direction[i - 1] : 0.0;
        out.p[i] = c * (P[0] + out.p[0]) - P[i];
        out.C[i][0] = c * out.C[0][0];
    }
}

template <int N>
void InteriorPoint<N>::find_directions(Target target) {
    const auto &groups = trees_.groups();
    for (std::size_t g = 0; g < groups.size(); ++g)
        respond(pairs_[g], groups[g], &P_[groups[g].first], &y_[groups[g].first], target, responses_[g]);
    if (!target.corrects) trees_.factorise(responses_);
    trees_.step(responses_, dP_, dy_, REFINEMENTS);
    for (std::size_t g = 0; g < groups.size(); ++g)
        direction(pairs_[g], groups[g], &dP_[groups[g].first], &dy_[groups[g].first], target);
}

template <int N>
void InteriorPoint<N>::direction(Pair &pair, const Group &group, const double *dP, const double *dy, Target target) {
    const double dx = dP[0] * pair.root_N / unit_;
    for (Scalar *s : {&pair.normal, &pair.upper}) {
        if (!s->exists) continue;
        const double goal = target.of(*s);
        s->dx = s == &pair.normal ? dx : -dx;
        s->dz = (goal - s->z * s->dx) / s->x - s->z;
    }
    if (!pair.n) return;
    const Scaling &s = pair.scaling;
    pair.dx.x[0] = group.mu * dP[0] * pair.root_F / unit_;
    double psi = pair.q.x[0] - pair.dx.x[0];
    for (int i = 1; i < pair.n; ++i) {
        pair.dx.x[i] = dP[i] * pair.root_F / unit_;
        pair.dz.x[i] = pair.left_F[i] + dy[i] / (pair.root_F * unit_) + rest_ * pair.dx.x[i];
        psi -= s.square[0][i] * pair.dz.x[i];
    }
    pair.dz.x[0] = psi / s.square[0][0];
}

template <int N>
double InteriorPoint<N>::longest() const {
    double most = 1.0 / INSIDE;
    for (const Pair &pair : pairs_) {
        for (const Scalar *s : {&pair.normal, &pair.upper}) {
            if (!s->exists) continue;
            if (s->dx < 0.0) most = std::min(most, -s->x / s->dx);
            if (s->dz < 0.0) most = std::min(most, -s->z / s->dz);
        }
        if (pair.n) most = std::min(pair.x.reach(pair.dx, pair.n, most), pair.z.reach(pair.dz, pair.n, most));
    }
    return INSIDE * most;
}

template <int N>
bool InteriorPoint<N>::advance() {
    for (Pair &pair : pairs_)
        if (pair.n) pair.scaling.set(pair.x, pair.z, pair.n);
    rest_ = std::max(REST, REST_OF_GAP * gap_);
    find_directions({0.0, false});
    const double far = longest(), centre = std::pow(1.0 - std::min(far, 1.0), 3);
    find_directions({centre * gap_, true});
    const double step = longest();
    if (!(step > STUCK)) return false;
    P_ += step * dP_;
    for (Pair &pair : pairs_) {
        for (Scalar *s : {&pair.normal, &pair.upper}) {
            s->x += step * s->dx;
            s->z += step * s->dz;
        }
        for (int i = 0; i < pair.n; ++i) {
            pair.x.x[i] += step * pair.dx.x[i];
            pair.z.x[i] += step * pair.dz.x[i];
        }
    }
    measure();
    return std::isfinite(gap_) && std::isfinite(residual_);
}

}  // namespace nga
