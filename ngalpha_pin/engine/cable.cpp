#include "cable.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <stdexcept>

#include "tolerances.hpp"

namespace nga {

// What a strain counts for the tension, its derivatives and its integral: none below zero, a parabola, then itself.
struct Taut {
    double value, slope, curve, energy;
};

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Point = Eigen::Map<const Vector3d>;

const double KINK = 1e-9;  // strain over which a slack segment becomes a taut one: Newton needs a derivative there

Taut taut(double strain) {
    if (strain <= 0.0) return {0.0, 0.0, 0.0, 0.0};
    if (strain < KINK)
        return {0.5 * strain * strain / KINK, strain / KINK, 1.0 / KINK, strain * strain * strain / (6.0 * KINK)};
    return {strain - 0.5 * KINK, 1.0, 0.0, 0.5 * strain * (strain - KINK) + KINK * KINK / 6.0};
}

}  // namespace

struct Cable::Segment {
    Vector3d along, rate;  // unit vector from node to node, and their relative velocity
    double length, strain_rate, tension;
    Taut taut;
};

Cable::Cable(std::vector<double> lengths, double EA, double damping)
    : lengths_(std::move(lengths)), EA_(EA), damping_(damping) {
    if (lengths_.empty()) throw std::invalid_argument("a cable has a segment or more");
}

Cable::Segment Cable::segment(int i, const double *x, const double *v) const {
    Segment found;
    const Vector3d way = Point(x + 3 * i + 3) - Point(x + 3 * i);
    found.length = std::max(way.norm(), TINY);
    found.along = way / found.length;
    found.rate = Point(v + 3 * i + 3) - Point(v + 3 * i);
    found.strain_rate = found.along.dot(found.rate) / lengths_[i];
    found.taut = taut((found.length - lengths_[i]) / lengths_[i]);
    found.tension = std::max(EA_ * (found.taut.value + damping_ * found.taut.slope * found.strain_rate), 0.0);
    return found;
}

double Cable::energy(const double *x) const {
    double found = 0.0;
    for (int i = 0; i + 1 < nodes(); ++i) {
        const double length = (Point(x + 3 * i + 3) - Point(x + 3 * i)).norm();
        found += EA_ * lengths_[i] * taut((length - lengths_[i]) / lengths_[i]).energy;
    }
    return found;
}

double Cable::damping_power(const double *x, const double *v) const {
    double found = 0.0;
    for (int i = 0; i + 1 < nodes(); ++i) {
        const Segment at = segment(i, x, v);
        found -= (at.tension - EA_ * at.taut.value) * at.strain_rate * lengths_[i];
    }
    return found;
}

void Cable::tensions(const double *x, const double *v, double *to) const {
    for (int i = 0; i + 1 < nodes(); ++i) to[i] = segment(i, x, v).tension;
}

void Cable::subtract(const double *x, const double *v, double *tau, double *K, double *D, int stride) const {
    using Into = Eigen::Map<Matrix3d, 0, Eigen::OuterStride<>>;
    for (int i = 0; i + 1 < nodes(); ++i) {
        const Segment at = segment(i, x, v);
        if (at.tension <= 0.0) continue;
        const Vector3d &u = at.along, force = at.tension * u;
        const Matrix3d across = (Matrix3d::Identity() - u * u.transpose()) / at.length;
        const Vector3d by_way = EA_ / lengths_[i] * ((at.taut.slope + damping_ * at.taut.curve * at.strain_rate) * u +
                                                     damping_ * at.taut.slope * (across * at.rate));
        const Matrix3d by_q = u * by_way.transpose() + at.tension * across;
        const Matrix3d by_v = EA_ * damping_ * at.taut.slope / lengths_[i] * (u * u.transpose());
        Eigen::Map<Vector3d>{tau + 3 * i} += force;
        Eigen::Map<Vector3d>{tau + 3 * i + 3} -= force;
        for (int a = 0; a < 2; ++a)
            for (int b = 0; b < 2; ++b) {
                const int corner = (3 * i + 3 * b) * stride + 3 * i + 3 * a;
                const double sign = a == b ? -1.0 : 1.0;
                Into(K + corner, Eigen::OuterStride<>(stride)) += sign * by_q;
                Into(D + corner, Eigen::OuterStride<>(stride)) += sign * by_v;
            }
    }
}

}  // namespace nga
