#include "solid_pairs.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace nga {
namespace {

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;
using Rows = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Eigen::Map<const Vector> vector(const double *from) { return Eigen::Map<const Vector>(from); }
Eigen::Map<const Matrix> rotation(const Mechanism &m, int joint) { return Eigen::Map<const Matrix>(m.rotation(joint)); }
Eigen::Map<const Vector> translation(const Mechanism &m, int joint) { return vector(m.translation(joint)); }

// 2 sin(angle / 2) of the turn between two rotations
double turned(const Matrix &R, const double *from) {
    return std::sqrt(0.5 * (R - Eigen::Map<const Rows>(from)).squaredNorm());
}

// How far any point of a joint's shapes has moved since all pairs were looked at, at most [m].
double way(const SolidPairs &pairs, const Looks &looks, const Mechanism &m, int joint) {
    const double moved = (translation(m, joint) - vector(looks.seen_p + 3 * joint)).norm();
    return moved + turned(rotation(m, joint), looks.seen_R + 9 * joint) * pairs.extent[joint];
}

// Lower bound of the distance of pair i from spheres around both [m].
double spheres(const SolidPairs &pairs, const Mechanism &m, int i) {
    const int a = pairs.a[i], b = pairs.b[i];
    const Vector on_a = rotation(m, a) * vector(&pairs.centres_a[3 * i]) + translation(m, a);
    const Vector between = rotation(m, b) * vector(&pairs.centres_b[3 * i]) + translation(m, b) - on_a;
    const Vector wall = vector(&pairs.walls[3 * i]);
    if (wall.isZero(0.0)) return between.norm() - pairs.radii[i];
    const double height = (rotation(m, a) * wall).dot(between);
    return (pairs.two_sided[i] != 0.0 ? std::abs(height) : height) - pairs.radii[i];
}

// Bound of the speed of any point of B seen from A of pair i [m/s].
double speed(const SolidPairs &pairs, const Mechanism &m, int i) {
    const int a = pairs.a[i], b = pairs.b[i];
    const Vector omega_a = rotation(m, a) * vector(m.angular(a)), omega_b = rotation(m, b) * vector(m.angular(b));
    const Vector c = rotation(m, b) * vector(&pairs.centres_b[3 * i]);
    const Vector of_a = rotation(m, a) * vector(m.linear(a)) + omega_a.cross(c + translation(m, b) - translation(m, a));
    const Vector of_b = rotation(m, b) * vector(m.linear(b)) + omega_b.cross(c);
    return (of_b - of_a).norm() + (omega_b - omega_a).norm() * pairs.size_b[i];
}

// What the last look at pair i leaves of its distance [m].
double remembered(const SolidPairs &pairs, const Looks &looks, const Mechanism &m, int i) {
    const Matrix R_a = rotation(m, pairs.a[i]).transpose(), R = R_a * rotation(m, pairs.b[i]);
    const Vector between = translation(m, pairs.b[i]) - translation(m, pairs.a[i]);
    const Vector x = R_a * between + R * vector(&pairs.centres_b[3 * i]);
    const double moved = (x - vector(looks.x + 3 * i)).norm();
    return looks.found[i] - moved - turned(R, looks.R + 9 * i) * pairs.size_b[i] - pairs.doubt[i];
}

}  // namespace

double SolidPairs::motion(const double *dq, const std::vector<double> &reach) const {
    const auto of_body = [&](int body) {
        double sum = 0.0;
        for (int i = 0; i < nv; ++i)
            if (support[body * nv + i] > 0.0 && dq[i] != 0.0) sum += std::abs(dq[i]) * reach[i];
        return sum;
    };
    double most = 0.0;
    for (std::size_t i = 0; i < bodies_a.size(); ++i) most = std::max(most, of_body(bodies_a[i]) + of_body(bodies_b[i]));
    for (std::size_t i = 0; i < limits.size(); ++i) most = std::max(most, std::abs(dq[limits[i]]) * measure[i]);
    return most;
}

bool all_apart(const SolidPairs &pairs, const Looks &looks, const Mechanism &m, double ahead) {
    if (looks.seen_p == nullptr) return false;
    double furthest = 0.0, fastest = 0.0;
    for (int joint = 0; joint < static_cast<int>(pairs.extent.size()); ++joint) {
        furthest = std::max(furthest, way(pairs, looks, m, joint));
        fastest = std::max(fastest, vector(m.linear(joint)).norm() + vector(m.angular(joint)).norm() * pairs.extent[joint]);
    }
    if (!(2.0 * furthest + 2.0 * ahead * fastest <= looks.others_from)) return false;
    return std::all_of(looks.listed.begin(), looks.listed.end(), [&](int i) {
        const double own = ahead * speed(pairs, m, i);
        return spheres(pairs, m, i) > own || remembered(pairs, looks, m, i) > own;
    });
}

}  // namespace nga
