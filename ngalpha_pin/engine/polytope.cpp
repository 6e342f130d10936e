// Boxes, convex shapes, hulls of meshes, triangles.
#include <algorithm>
#include <numeric>

#include "solid.hpp"

namespace nga {
namespace {

constexpr double MOST_TURN = 0.1;  // turn of a step beyond which corners are found by the looks at its end [rad]

int first_largest(const Eigen::VectorXd &x) {
    int largest = 0;
    for (int i = 1; i < x.size(); ++i)
        if (x[i] > x[largest]) largest = i;
    return largest;
}

}  // namespace

Polytope::Polytope(Table V, Table normals, Eigen::VectorXd offsets, std::vector<std::vector<int>> members, Edges edges,
                   double r, Vector centre, double size, std::shared_ptr<const Beside> beside)
    : Solid(std::move(centre), size), V_(std::move(V)), normals_(std::move(normals)), offsets_(std::move(offsets)),
      members_(std::move(members)), edges_(std::move(edges)), r_(r), beside_(std::move(beside)) {}

Vector Polytope::support(const Vector &m) const { return corner(first_largest(V_ * m)) + r_ * m; }

Feature Polytope::feature(int i) const {
    const Vector normal = normals_.row(i).transpose();
    return plane(offsets_[i] * normal, normal, r_);
}

Feature Polytope::feature_at(const Vector &p, const Vector &m) const {
    const double near = ON * size;
    const Vector core = p - r_ * m;
    const Eigen::VectorXd depth = offsets_ - normals_ * core;
    std::vector<int> all, on;
    for (int i = 0; i < depth.size(); ++i)
        if (depth[i] < near) all.push_back(i);
    // a flat polygon has two sides everywhere; a sharp edge belongs to both of its faces whatever the direction
    for (int i : all) {
        const auto back = [&](int j) { return normals_.row(i).dot(normals_.row(j)) < -ALIGNED; };
        if (!(normals_.row(i).dot(m) < 0.0 && std::any_of(all.begin(), all.end(), back))) on.push_back(i);
    }
    if (on.size() == 1) return feature(on[0]);
    int nearest = 0;
    (V_.rowwise() - core.transpose()).rowwise().squaredNorm().minCoeff(&nearest);
    Feature found = point(corner(nearest), r_);
    if (on.empty() || (corner(nearest) - core).cwiseAbs().maxCoeff() < near) return found;
    // of the edges between these faces the one that the point is nearest to
    double least = INFINITY;
    for (std::size_t i = 0; i < on.size(); ++i)
        for (std::size_t j = i + 1; j < on.size(); ++j) {
            std::vector<int> one = members_[on[i]], two = members_[on[j]], shared;
            std::sort(one.begin(), one.end()), std::sort(two.begin(), two.end());
            std::set_intersection(one.begin(), one.end(), two.begin(), two.end(), std::back_inserter(shared));
            if (shared.size() != 2) continue;
            const Vector a = corner(shared[0]), way = corner(shared[1]) - a, direction = way / way.norm();
            const Vector foot = a + (core - a).dot(direction) * direction;
            const double distance = (foot - core).cwiseAbs().maxCoeff();
            if (distance < least) found = line(foot, direction, r_), least = distance;
        }
    return found;
}

std::optional<Face> Polytope::face(const Vector &m, double aligned) const {
    const int i = first_largest(normals_ * m);
    if (!(normals_.row(i).dot(m) > aligned) || members_[i].size() <= 2) return std::nullopt;
    if (beside_ && !beside_->get().faces[i]) return std::nullopt;
    return side(i);
}

Face Polytope::side(int i) const {
    Face found{feature(i), normals_.row(i).transpose(), {}, 0.0};
    for (int k : members_[i]) found.corners.push_back(corner(k));
    return found;
}

// A corner is the farthest one along a direction that is turned by an angle only if none that it shares an edge with
// stands out farther than the angle times their distance across m. So angles decide, not lengths, and a plate may be as
// thin as it likes.
Corners Polytope::corners(const Vector &m, const Turn &turn) const {
    const Eigen::VectorXd height = V_ * m;
    const double angle = turn ? std::sqrt(turn->dot(*turn)) : 0.0;
    const double slope = 2.0 * std::min(angle, MOST_TURN), rounding = ROUNDING * height.cwiseAbs().maxCoeff();
    std::vector<char> near(V_.rows(), 1);
    for (int k = 0; k < edges_.rows(); ++k) {
        const int first = edges_(k, 0), second = edges_(k, 1);
        const double rise = height[second] - height[first];
        const double across = std::sqrt(std::max((corner(second) - corner(first)).squaredNorm() - rise * rise, 0.0));
        const double least = slope * across + rounding;
        if (rise > least) near[first] = 0;
        if (-rise > least) near[second] = 0;
    }
    const int i = first_largest(normals_ * m);
    if (normals_.row(i).dot(m) > 0.5)
        for (int k : members_[i]) near[k] = 1;
    Corners found;
    for (int k = 0; k < V_.rows(); ++k)
        if (near[k]) found.push_back({corner(k), Matrix::Zero(), r_, false});
    return found;
}

std::optional<Face> Polytope::farthest_face(const Solid &other, const Pose &X) const {
    const Exposed *surface = exposed();
    if (surface == nullptr) return std::nullopt;
    double most = -INFINITY;
    int found = -1;
    for (int i = 0; i < offsets_.size(); ++i) {
        if (!surface->faces[i]) continue;
        const Vector m = normals_.row(i).transpose();
        const double height = m.dot(X.act(other.support(-(X.R.transpose() * m)))) - offsets_[i];
        if (height > most) most = height, found = i;
    }
    if (found < 0) return std::nullopt;
    return side(found);
}

}  // namespace nga
