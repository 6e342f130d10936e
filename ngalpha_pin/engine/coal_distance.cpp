// Distances by coal. No other file of the engine calls it.
#include <coal/collision_data.h>
#include <coal/distance.h>
#include <coal/shape/geometric_shapes.h>

#include <stdexcept>
#include <string>

#include "shape_pair.hpp"

namespace nga {
namespace {

// of round shapes that overlap coal finds the depth to the first of these, now and then only to the second one; a huge
// number says so
constexpr double COAL_TOLERANCES[] = {1e-10, 1e-8, 1e-6}, FAILED = 1e300;

// The hull of points, with the neighbours that it had in Python.
class Hull final : public coal::ConvexBase {
public:
    Hull(const std::vector<Vector> &corners, const std::vector<std::vector<unsigned>> &around) {
        initialize(std::make_shared<std::vector<coal::Vec3s>>(corners.begin(), corners.end()),
                   static_cast<unsigned>(corners.size()));
        nneighbors_ = std::make_shared<std::vector<unsigned>>();
        for (const auto &others : around) nneighbors_->insert(nneighbors_->end(), others.begin(), others.end());
        neighbors = std::make_shared<std::vector<Neighbors>>(corners.size());
        unsigned *next = nneighbors_->data();
        for (std::size_t i = 0; i < around.size(); ++i) {
            (*neighbors)[i].count_ = static_cast<unsigned char>(around[i].size());
            (*neighbors)[i].n_ = next;
            next += around[i].size();
        }
        buildSupportWarmStart();
    }
};

}  // namespace

Nearest ShapePair::distance(const Pose &X) const {
    if (const Wall *wall = dynamic_cast<const Wall *>(a.get())) {
        Vector n = wall->normal;
        if (wall->two_sided && n.dot(X.act(b->centre) - wall->centre) < 0.0) n = -n;
        const Vector p = X.act(b->support(-(X.R.transpose() * n)));
        const double d = n.dot(p - wall->centre);
        return {d, n, p - d * n, p};
    }
    const coal::Transform3s at_a(place_a.R, place_a.p), at_b(X.R * place_b.R, X.p + X.R * place_b.p);
    Nearest found{};
    for (double tolerance : COAL_TOLERANCES) {
        coal::DistanceRequest request;
        coal::DistanceResult result;
        request.gjk_tolerance = request.epa_tolerance = tolerance;
        const double d = coal::distance(shape_a.get(), at_a, shape_b.get(), at_b, request, result);
        found = {d, result.normal, result.nearest_points[0], result.nearest_points[1]};
        if (d > -FAILED) break;
    }
    return found;
}

std::shared_ptr<coal::CollisionGeometry> shape_for_coal(const std::string &kind, const std::vector<double> &x,
                                                        double swept) {
    std::shared_ptr<coal::ShapeBase> found;
    if (kind == "Sphere") found = std::make_shared<coal::Sphere>(x.at(0));
    if (kind == "Ellipsoid") found = std::make_shared<coal::Ellipsoid>(x.at(0), x.at(1), x.at(2));
    if (kind == "Capsule") found = std::make_shared<coal::Capsule>(x.at(0), 2 * x.at(1));
    if (kind == "Cylinder") found = std::make_shared<coal::Cylinder>(x.at(0), 2 * x.at(1));
    if (kind == "Cone") found = std::make_shared<coal::Cone>(x.at(0), 2 * x.at(1));
    if (kind == "Box") found = std::make_shared<coal::Box>(2 * x.at(0), 2 * x.at(1), 2 * x.at(2));
    if (!found) throw std::invalid_argument("coal has no distances of a " + kind);
    found->setSweptSphereRadius(swept);
    return found;
}

std::shared_ptr<coal::CollisionGeometry> hull_for_coal(const std::vector<Vector> &points,
                                                       const std::vector<std::vector<unsigned>> &neighbours, double swept) {
    auto found = std::make_shared<Hull>(points, neighbours);
    found->setSweptSphereRadius(swept);
    return found;
}

}  // namespace nga
