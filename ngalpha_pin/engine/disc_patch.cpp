// A point of the patch is one of the upper body for a step: on parallel planes all of them have the same kinematics, and
// along a border, where a body may tip, they are found again in every step.
#include "disc_patch.hpp"

#include <algorithm>
#include <functional>

#include "face_clipping.hpp"

namespace nga {
namespace {

using Angles = std::vector<double>;
constexpr double INCLINED = 1e-12;  // sine of an inclination that is rounding
// how many of the points of a rim that stands are fixed in its body, whatever is below it
constexpr std::size_t STANDING = 4;
constexpr int POLISHED = 3;        // Newton's iterations for the crossings of a rim that is inclined

// A rim seen along the normal of a face: middle + cos(angle) first + sin(angle) second.
struct Rim {
    Vector c, e1, e2;
    Flat middle, first, second;
    double radius, swept;

    Rim(const Face &cap, const Frame &frame) : c(cap.feature.c), radius(cap.radius), swept(cap.feature.r) {
        tangents(cap.normal, e1, e2);
        middle = frame.flat(c + swept * cap.normal);
        first = radius * frame.flat(e1), second = radius * frame.flat(e2);
    }
    Flat at(double angle) const { return middle + std::cos(angle) * first + std::sin(angle) * second; }
    Flat slope(double angle) const { return std::cos(angle) * second - std::sin(angle) * first; }
    Vector point(double angle) const { return c + radius * (std::cos(angle) * e1 + std::sin(angle) * e2); }
    double angle(const Vector &direction) const { return std::atan2(direction.dot(e2), direction.dot(e1)); }
};

// A face seen along its normal, a little larger than it is, as for other corners that lie on a side.
struct Region {
    std::vector<Border> sides;
    Flat middle = Flat::Zero();
    double radius = 0.0;

    Region(const Face &face, const Frame &frame) {
        if (face.radius > 0.0)
            middle = frame.flat(face.feature.c + face.feature.r * face.normal), radius = face.radius * (1.0 + ON_SIDE);
        else
            sides = borders(face, frame);
    }
    bool has(const Flat &x) const {
        if (radius > 0.0) return (x - middle).norm() <= radius;
        return std::all_of(sides.begin(), sides.end(), [&](const Border &s) { return s.inwards.dot(x) >= s.offset; });
    }
    Angles crossings(const Rim &rim) const;
};

// Angles with a cos + b sin = c.
void solve(double a, double b, double c, Angles &found) {
    const double size = std::hypot(a, b);
    if (!(std::abs(c) < size)) return;
    const double middle = std::atan2(b, a), half = std::acos(c / size);
    found.push_back(middle - half), found.push_back(middle + half);
}

Angles Region::crossings(const Rim &rim) const {
    Angles found;
    if (radius > 0.0) {
        const Flat d = rim.middle - middle;
        solve(2 * d.dot(rim.first), 2 * d.dot(rim.second), radius * radius - d.squaredNorm() - rim.radius * rim.radius, found);
        for (double &angle : found)
            for (int i = 0; i < POLISHED; ++i) {
                const Flat x = rim.at(angle) - middle;
                const double rate = 2 * x.dot(rim.slope(angle));
                if (rate != 0.0) angle -= (x.squaredNorm() - radius * radius) / rate;
            }
        return found;
    }
    for (const Border &side : sides) {
        Angles here;
        solve(side.inwards.dot(rim.first), side.inwards.dot(rim.second), side.offset - side.inwards.dot(rim.middle), here);
        for (double angle : here) {
            const Flat x = rim.at(angle);
            const auto outside = [&](const Border &s) { return &s != &side && s.inwards.dot(x) < s.offset; };
            if (std::none_of(sides.begin(), sides.end(), outside)) found.push_back(angle);
        }
    }
    return found;
}

// Crossings of a rim with the border of a region, and points of its arcs inside: a quarter of a turn apart at most.
struct Arcs {
    Angles crossings, inside;

    Arcs(const Rim &rim, const Region &region) : crossings(region.crossings(rim)) {
        const double turn = 2 * M_PI;
        for (double &x : crossings) x -= turn * std::floor(x / turn);
        std::sort(crossings.begin(), crossings.end());
        const std::size_t n = crossings.size();
        if (n == 0) {  // all of it or nothing; then they are fixed in the body
            if (region.has(rim.at(0.0))) inside = {0.0, M_PI_2, M_PI, 3 * M_PI_2};
            return;
        }
        for (std::size_t i = 0; i < n; ++i) {
            const double from = crossings[i], length = crossings[(i + 1) % n] + (i + 1 == n ? turn : 0.0) - from;
            if (!region.has(rim.at(from + 0.5 * length))) continue;
            const int parts = std::max(2, static_cast<int>(std::ceil(length / M_PI_2)));
            for (int k = 1; k < parts; ++k) inside.push_back(from + k * length / parts);
        }
    }
};

// Angles of the places on a rim, seen along the normal of a face.
Angles kept_on(const Rim &rim, const std::vector<Vector> &places, const Frame &frame) {
    Angles found;
    for (const Vector &p : places) {
        const double angle = rim.angle(p - rim.c);
        if ((rim.at(angle) - frame.flat(p)).norm() < ON * rim.radius) found.push_back(angle);
    }
    return found;
}

}  // namespace

Corners disc_over(const Face &on, const Frame &frame, const Face &up, const Corners &corners,
                  const std::vector<Vector> &kept) {
    const Region below(on, frame), above(up, frame);
    const Rim rim(up, frame);
    Corners found;
    for (std::size_t i = 0; i + STANDING < corners.size(); ++i)
        if (below.has(frame.place(corners[i]))) found.push_back(corners[i]);
    const auto add = [&](const Vector &core, bool cut) {
        const auto same = [&](const Corner &x) { return x.Q.isZero(0.0) && (x.c - core).norm() < ON * rim.radius; };
        if (std::none_of(found.begin(), found.end(), same)) found.push_back({core, Matrix::Zero(), rim.swept, cut});
    };
    // a point of a rim that carries a force is one of it still, wherever that is lowest now
    for (double angle : kept_on(rim, kept, frame))
        if (below.has(rim.at(angle))) add(rim.point(angle), false);
    const Arcs arcs(rim, below);
    for (double angle : arcs.crossings) add(rim.point(angle), true);
    for (double angle : arcs.inside) add(rim.point(angle), false);
    // what lies on the plane of the upper cap above a place of the face
    const double along = up.normal.dot(frame.n);
    const auto raised = [&](const Vector &x) {
        const Vector core = x + rim.swept * frame.n;
        return Vector(core + up.normal.dot(rim.c - core) / along * frame.n);
    };
    const auto is_over = [&](const Vector &core) { return (core - rim.c).norm() <= rim.radius * (1.0 + ON_SIDE); };
    for (const Vector &x : on.corners) {
        const Vector core = raised(x);
        if (is_over(core)) add(core, true);
    }
    if (!(on.radius > 0.0)) return found;
    const Rim lower(on, frame);
    const Vector lower_there = along * frame.n - up.normal;  // the upper cap is lowest on this side
    Angles angles = Arcs(lower, above).inside;
    if (lower_there.norm() > INCLINED) angles.push_back(lower.angle(lower_there));
    for (double angle : kept_on(lower, kept, frame)) angles.push_back(angle);
    for (double angle : angles) {
        const Vector core = raised(lower.point(angle) + lower.swept * frame.n);
        if (is_over(core)) add(core, true);
    }
    return found;
}

Corners cut_to_disc(const Corners &ordered, const Face &on, const Frame &frame) {
    const Region disc(on, frame);
    const std::size_t n = ordered.size();
    Corners found;
    for (std::size_t i = 0; i < n; ++i) {
        const Corner &a = ordered[i], &b = ordered[(i + 1) % n];
        const Flat start = frame.place(a) - disc.middle, way = frame.place(b) - disc.middle - start;
        const bool inside = start.norm() <= disc.radius;
        if (inside) found.push_back(a);
        if (n < 2 || (n == 2 && i == 1)) continue;
        const double A = way.squaredNorm(), B = start.dot(way), C = start.squaredNorm() - disc.radius * disc.radius;
        const double root = B * B - A * C;
        if (!(root > 0.0 && A > 0.0)) continue;
        for (double s : {(-B - std::sqrt(root)) / A, (-B + std::sqrt(root)) / A})
            if (s > ON_SIDE && s < 1.0 - ON_SIDE) found.push_back(between(a, b, s, -frame.n));
    }
    return found;
}

}  // namespace nga
