// Two convex shapes that may touch in any of their features; see collision/narrow_phase.py.
#pragma once
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "face_clipping.hpp"
#include "features.hpp"
#include "solid.hpp"

namespace coal {
class CollisionGeometry;
}

namespace nga {

struct Nearest {
    double distance;
    Vector normal, on_a, on_b;  // normal from A to B and nearest points, in the frame of A
};

struct ShapePair {
    std::shared_ptr<const Solid> a, b;
    std::shared_ptr<const coal::CollisionGeometry> shape_a, shape_b;  // null where a is a half-space or a plane
    Pose place_a, place_b;                                            // of these in the joints

    double size() const { return std::min(a->size, b->size); }

    // All for the pose X of joint B in joint A.

    // Signed distance, normal and nearest points.
    Nearest distance(const Pose &X) const;
    // Distance along a unit normal n from A to B: the gap is its maximum over all n [m].
    double separation(const Pose &X, const Vector &n) const;
    // Normal and nearest points, also where the shapes touch or penetrate a little.
    Nearest nearest(const Pose &X, const Vector *hint) const;
    // Features with which the pair touches or is about to; none where others are surface beside it.
    std::vector<Row> features(const Pose &X, const Turn &turn, const std::vector<Row> &before,
                              const std::vector<Row> &carry) const;
};

// The shape that coal measures: sphere (r), capsule (r, half length), ellipsoid (semi-axes), cylinder and cone (r, half
// length), box (half sides), all swept by a radius; and the hull of points with the neighbours of each.
std::shared_ptr<coal::CollisionGeometry> shape_for_coal(const std::string &kind, const std::vector<double> &numbers,
                                                        double swept);
std::shared_ptr<coal::CollisionGeometry> hull_for_coal(const std::vector<Vector> &points,
                                                       const std::vector<std::vector<unsigned>> &neighbours, double swept);

}  // namespace nga
