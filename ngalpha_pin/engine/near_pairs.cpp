#include "near_pairs.hpp"

#include <algorithm>
#include <numeric>

namespace nga {
namespace {

using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// up to which distance pairs are listed in a look at all of them: so many times what was asked for, and at least this
// part of the size of a typical pair
constexpr double LISTED = 16.0, LISTED_SIZE = 0.5;

// 2 sin(angle / 2) of the turn between two rotations
double turned(const Matrix &R, const double *from) {
    return std::sqrt(0.5 * (R - Eigen::Map<const Rows>(from)).squaredNorm());
}

}  // namespace

Pose Bodies::pose(int a, int b) const {
    const Pose on_a = pose(a), on_b = pose(b);
    return {on_a.R.transpose() * on_b.R, on_a.R.transpose() * (on_b.p - on_a.p)};
}

NearPairs::NearPairs(std::shared_ptr<const Pairs> pairs)
    : found(pairs->n(), -INFINITY), x(3 * pairs->n(), 0.0), R(9 * pairs->n(), 0.0), seen_R(9 * pairs->extent.size()),
      seen_p(3 * pairs->extent.size()), listed(pairs->n()), pairs_(std::move(pairs)), every_(listed.size()) {
    std::iota(every_.begin(), every_.end(), 0);
    listed = every_;
}

std::vector<int> NearPairs::within(const Bodies &bodies, double reach, double ahead) {
    const double most = ahead > 0.0 ? reach + 2.0 * ahead * fastest(bodies) : reach;
    std::vector<int> close;
    for (int i : near(bodies, most)) {
        const double to = ahead > 0.0 ? reach + ahead * speed(bodies, i) : reach;
        if (spheres(bodies, i) > to || remembered(bodies, i) > to || look(bodies, i) > to) continue;
        close.push_back(i);
    }
    return close;
}

// Pairs that may be nearer than `most`; all pairs where that is not finite.
const std::vector<int> &NearPairs::near(const Bodies &bodies, double most) {
    const int joints = static_cast<int>(pairs_->extent.size());
    if (seen && 2.0 * furthest(bodies) + most <= others_from) return listed;
    const double upto = std::max(LISTED * most, LISTED_SIZE * pairs_->typical);
    if (!std::isfinite(upto)) return every_;
    listed.clear();
    for (int i : every_) {
        // a wall that moves sweeps any distance
        const bool always = !pairs_->walls[i].isZero(0.0) && pairs_->a[i] > 0;
        if (always || !(spheres(bodies, i) > upto)) listed.push_back(i);
    }
    for (int joint = 0; joint < joints; ++joint) {
        const Pose at = bodies.pose(joint);
        Eigen::Map<Rows>(seen_R.data() + 9 * joint) = at.R;
        Eigen::Map<Vector>(seen_p.data() + 3 * joint) = at.p;
    }
    seen = true, others_from = upto;
    return listed;
}

void NearPairs::bounds(const Bodies &bodies, const std::vector<int> &among, const std::vector<double> &reach,
                       std::vector<int> &close, std::vector<double> &lower) const {
    for (std::size_t k = 0; k < among.size(); ++k) {
        const double apart = spheres(bodies, among[k]);
        if (apart > reach[k]) continue;
        close.push_back(among[k]), lower.push_back(std::max(apart, remembered(bodies, among[k])));
    }
}

double NearPairs::look(const Bodies &bodies, int i) {
    const Pose X = bodies.pose(pairs_->a[i], pairs_->b[i]);
    Eigen::Map<Vector>(x.data() + 3 * i) = X.act(pairs_->centres_b[i]);
    Eigen::Map<Rows>(R.data() + 9 * i) = X.R;
    ++looks;
    return found[i] = pairs_->shapes[i].distance(X).distance;
}

double NearPairs::speed(const Bodies &bodies, int i) const {
    const Pose on_a = bodies.pose(pairs_->a[i]), on_b = bodies.pose(pairs_->b[i]);
    const Vector omega_a = on_a.R * bodies.omega(pairs_->a[i]), omega_b = on_b.R * bodies.omega(pairs_->b[i]);
    const Vector c = on_b.R * pairs_->centres_b[i], turning = omega_b - omega_a;
    const Vector of_a = on_a.R * bodies.velocity(pairs_->a[i]) + omega_a.cross(c + on_b.p - on_a.p);
    const Vector of_b = on_b.R * bodies.velocity(pairs_->b[i]) + omega_b.cross(c);
    return (of_b - of_a).norm() + turning.norm() * pairs_->size_b[i];
}

// Lower bound of the distance from spheres around both [m].
double NearPairs::spheres(const Bodies &bodies, int i) const {
    const Pose on_a = bodies.pose(pairs_->a[i]);
    const Vector apart = bodies.pose(pairs_->b[i]).act(pairs_->centres_b[i]) - on_a.act(pairs_->centres_a[i]);
    if (pairs_->walls[i].isZero(0.0)) return apart.norm() - pairs_->radii[i];
    const double height = (on_a.R * pairs_->walls[i]).dot(apart);
    return (pairs_->two_sided[i] ? std::abs(height) : height) - pairs_->radii[i];
}

// What the last look leaves of the distance [m].
double NearPairs::remembered(const Bodies &bodies, int i) const {
    const Pose X = bodies.pose(pairs_->a[i], pairs_->b[i]);
    const double moved = (X.act(pairs_->centres_b[i]) - Eigen::Map<const Vector>(x.data() + 3 * i)).norm();
    return found[i] - moved - turned(X.R, R.data() + 9 * i) * pairs_->size_b[i] - pairs_->doubt[i];
}

bool NearPairs::all_apart(const Bodies &bodies, double ahead) const {
    if (!seen || !(2.0 * furthest(bodies) + 2.0 * ahead * fastest(bodies) <= others_from)) return false;
    return std::all_of(listed.begin(), listed.end(), [&](int i) {
        const double own = ahead * speed(bodies, i);
        return spheres(bodies, i) > own || remembered(bodies, i) > own;
    });
}

// How far any point of any shape has moved since then, at most [m].
double NearPairs::furthest(const Bodies &bodies) const {
    double most = 0.0;
    for (std::size_t joint = 0; joint < pairs_->extent.size(); ++joint) most = std::max(most, way(bodies, joint));
    return most;
}

// Bound of the speed of any point of a shape [m/s].
double NearPairs::fastest(const Bodies &bodies) const {
    double most = 0.0;
    for (std::size_t joint = 0; joint < pairs_->extent.size(); ++joint)
        most = std::max(most, bodies.velocity(joint).norm() + bodies.omega(joint).norm() * pairs_->extent[joint]);
    return most;
}

// How far any point of a joint's shapes has moved since all pairs were looked at, at most [m].
double NearPairs::way(const Bodies &bodies, int joint) const {
    const Pose at = bodies.pose(joint);
    const double moved = (at.p - Eigen::Map<const Vector>(seen_p.data() + 3 * joint)).norm();
    return moved + turned(at.R, seen_R.data() + 9 * joint) * pairs_->extent[joint];
}

}  // namespace nga
