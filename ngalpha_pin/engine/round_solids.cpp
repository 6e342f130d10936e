// Spheres, capsules, ellipsoids, cylinders, cones, half-spaces and planes.
#include <algorithm>

#include "solid.hpp"

namespace nga {
namespace {

// sine of the inclination below which the lowest point of a rim is not followed, and below which there is none
constexpr double FLAT = 1e-6, UPRIGHT = 1e-9;

double sign(double x) { return (x > 0.0) - (x < 0.0); }

}  // namespace

Vector Round::support(const Vector &m) const { return end(sign(half_.dot(m))).support(m); }

Feature Round::feature_at(const Vector &p, const Vector &) const {
    const double length = half_.norm();
    if (length == 0.0) return end(0.0).feature();
    const double along = (p - centre).dot(half_) / (length * length);
    if (std::abs(along) >= 1.0) return end(sign(along)).feature();
    return line(centre + along * half_, half_ / length, r_);
}

Corners Round::corners(const Vector &, const Turn &) const {
    if (half_.isZero(0.0)) return {end(0.0)};
    return {end(-1.0), end(1.0)};
}

Turned::Turned(Vector first, Vector second, Vector axis, double radius_1, double radius_2, double r, Vector centre,
               double size)
    : Solid(std::move(centre), size), ends_{std::move(first), std::move(second)}, axis_(std::move(axis)),
      radii_{radius_1, radius_2}, r_(r) {
    for (int i : {0, 1}) {
        const Vector normal = i ? axis_ : Vector(-axis_);
        caps_[i] = {plane(ends_[i], normal, r_), normal, {}, radii_[i]};
    }
}

Vector Turned::support(const Vector &m) const {
    // not from the disc's Q: the root of its rounding is half of the digits where m is nearly along the axis
    const Vector across = m - m.dot(axis_) * axis_;
    const double sine = across.norm();
    Vector out = Vector::Zero();
    if (sine > 0.0) {  // projected again, since what is across may be rounding
        out = across / sine;
        out -= out.dot(axis_) * axis_;
        const double size = out.norm();
        out = size > 0.1 ? Vector(out / size) : Vector(Vector::Zero());
    }
    const Vector first = ends_[0] + radii_[0] * out, second = ends_[1] + radii_[1] * out;
    return (m.dot(second) > m.dot(first) ? second : first) + r_ * m;
}

Feature Turned::feature_at(const Vector &p, const Vector &m) const {
    const Vector core = p - r_ * m;
    const double height = (core - ends_[0]).dot(axis_), length = (ends_[1] - ends_[0]).dot(axis_);
    const double near = ON * size;
    const Vector rho = core - ends_[0] - height * axis_;
    const double distance = rho.norm();
    for (int i : {0, 1}) {
        const double z = i ? length - height : height, outwards = i ? 1.0 : -1.0;
        if (!(z < near)) continue;
        if (radii_[i] == 0.0) return point(ends_[i], r_);
        const bool inside = distance < radii_[i] - near && m.dot(axis_) * outwards > STANDS;
        return inside ? caps_[i].feature : rim_at(i);
    }
    if (radii_[0] == radii_[1]) return line(ends_[0] + height * axis_, axis_, radii_[0] + r_);
    // the side of a cone: the cylinder that has its curvature there, about an axis through the point below it
    const Vector out = rho / std::max(distance, TINY);
    const double slope = (radii_[0] - radii_[1]) / length, steep = std::sqrt(1 + slope * slope);
    const Vector normal = (out + slope * axis_) / steep;
    const double radius = (radii_[0] - slope * height) * steep;
    const Vector on_side = ends_[0] + height * axis_ + (radii_[0] - slope * height) * out;
    return line(on_side - radius * normal, (axis_ - slope * out) / steep, radius + r_);
}

std::optional<Face> Turned::face(const Vector &m, double aligned) const {
    const double along = m.dot(axis_);
    const int i = along > 0.0;
    if (std::abs(along) < aligned || radii_[i] == 0.0) return std::nullopt;
    return caps_[i];
}

Corners Turned::corners(const Vector &m, const Turn &turn) const {
    const double along = m.dot(axis_);
    const Vector across = m - along * axis_;
    const double sine = across.norm();
    Corners found;
    for (int i : {0, 1}) {
        const double outwards = i ? along : -along;
        if (radii_[i] == 0.0)
            found.push_back({ends_[i], Matrix::Zero(), r_, false});
        else if (outwards >= -STANDS)
            points_of_rim(i, across, sine, outwards > STANDS, turn, found);
    }
    return found;
}

// The lowest point of a rim and, where the shape nearly stands on it, four that are fixed in the body: so it stands on
// the same points whatever is below them, pieces of a floor for example.
void Turned::points_of_rim(int i, const Vector &across, double sine, bool stands, const Turn &turn, Corners &found) const {
    const Vector &centre = ends_[i];
    const auto fixed = [&](const Vector &d) { found.push_back({centre + radii_[i] * d, Matrix::Zero(), r_, false}); };
    if (sine > UPRIGHT) {
        // the lowest point runs around the rim: it is followed where a step resolves that
        const double turned = turn ? turn->cross(axis_).norm() : INFINITY;
        if (sine > std::max(2.0 * turned, FLAT))
            found.push_back({centre, rim_at(i).Q, r_, false});
        else
            found.push_back({centre + radii_[i] * across / sine, Matrix::Zero(), r_, false});
    }
    if (!stands) return;
    Vector t1, t2;
    tangents(axis_, t1, t2);
    fixed(t1), fixed(t2), fixed(-t1), fixed(-t2);
}

Wall::Wall(Vector n, Vector c, bool two_sided) : Solid(std::move(c), INFINITY), normal(std::move(n)), two_sided(two_sided) {}

std::optional<Face> Wall::face(const Vector &m, double) const {
    const Vector n = two_sided && m.dot(normal) < 0.0 ? Vector(-normal) : normal;
    return Face{plane(centre, n, 0.0), n, {}, 0.0};
}

}  // namespace nga
