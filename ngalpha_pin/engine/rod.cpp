#include "rod.hpp"

#include <cmath>
#include <stdexcept>

namespace nga {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using Turning = Eigen::Matrix<double, 4, 3>;
using Matrix18 = Eigen::Matrix<double, 18, 18>;
using Vector18 = Eigen::Matrix<double, 18, 1>;

const double GAUSS = 1.0 / std::sqrt(3.0);  // two points on [-1, 1], each of weight 1

// p o (omega, 0) = turning(p) omega.
Turning turning(const Vector4d &p) {
    Turning L;
    L << p[3], -p[2], p[1],  //
        p[2], p[3], -p[0],   //
        -p[1], p[0], p[3],   //
        -p[0], -p[1], -p[2];
    return L;
}

Eigen::Matrix3d skew(const Vector3d &x) {
    Eigen::Matrix3d found;
    found << 0.0, -x[2], x[1], x[2], 0.0, -x[0], -x[1], x[0], 0.0;
    return found;
}

}  // namespace

Rod::Rod(std::vector<double> places, std::vector<double> stiffness, const std::vector<double> &reference, double damping)
    : places_(std::move(places)), damping_(damping) {
    if (places_.size() < 3 || places_.size() % 2 == 0 || stiffness.size() != 36 || reference.size() != 7 * places_.size())
        throw std::invalid_argument("a rod has three nodes or more, 36 stiffnesses and 7 numbers a node");
    stiffness_ = Eigen::Map<const Matrix6>(stiffness.data());
    points_.resize(2 * elements());
    for (int e = 0; e < elements(); ++e) {
        const Element nodes = element(e, reference.data());
        // quadratic Lagrange functions of xi in [-1, 1] by the places of the three nodes: the middle one may be off
        for (int g = 0; g < 2; ++g) {
            Point &point = points_[2 * e + g];
            const double *s = &places_[2 * e], half = 0.5 * (s[2] - s[0]);
            const double x = s[0] + half * (1.0 + (g == 0 ? -GAUSS : GAUSS));
            Vector3d r_x = Vector3d::Zero();
            for (int k = 0; k < 3; ++k) {
                const double a = s[(k + 1) % 3], b = s[(k + 2) % 3], scale = (s[k] - a) * (s[k] - b);
                point.N[k] = (x - a) * (x - b) / scale, point.N_s[k] = (2.0 * x - a - b) / scale;
                r_x += point.N_s[k] * nodes.r[k];
            }
            const double stretch = r_x.norm();
            if (!(stretch > 0.0)) throw std::invalid_argument("the undeformed rod stands still somewhere");
            point.weight = half * stretch;
            for (int k = 0; k < 3; ++k) point.N_s[k] /= stretch;
            point.e = strains(at(point, nodes));
        }
    }
}

std::vector<double> Rod::lengths() const {
    std::vector<double> found(elements());
    for (int e = 0; e < elements(); ++e) found[e] = points_[2 * e].weight + points_[2 * e + 1].weight;
    return found;
}

std::vector<double> Rod::gauss_places() const {
    std::vector<double> found;
    for (int e = 0; e < elements(); ++e)
        for (double side : {-GAUSS, GAUSS})
            found.push_back(places_[2 * e] + 0.5 * (places_[2 * e + 2] - places_[2 * e]) * (1.0 + side));
    return found;
}

Rod::Element Rod::element(int e, const double *x) const {
    Element found;
    for (int k = 0; k < 3; ++k) {
        const double *node = x + 7 * (2 * e + k);
        found.r[k] = Eigen::Map<const Vector3d>(node);
        found.p[k] = Eigen::Map<const Vector4d>(node + 3);
        if (k > 0 && found.p[k].dot(found.p[k - 1]) < 0.0) found.p[k] = -found.p[k];
    }
    return found;
}

Vector11 Rod::at(const Point &point, const Element &nodes) {
    Vector11 x = Vector11::Zero();
    for (int k = 0; k < 3; ++k) {
        x.head<3>() += point.N_s[k] * nodes.r[k];
        x.segment<4>(3) += point.N[k] * nodes.p[k];
        x.tail<4>() += point.N_s[k] * nodes.p[k];
    }
    return x;
}

// Derivative of x by v: velocities of the nodes in the world, angular velocities in their own axes.
Rod::Dofs Rod::rates(const Point &point, const Element &nodes) {
    Dofs B = Dofs::Zero();
    for (int k = 0; k < 3; ++k) {
        const Turning L = 0.5 * turning(nodes.p[k]);
        B.block<3, 3>(0, 6 * k).diagonal().setConstant(point.N_s[k]);
        B.block<4, 3>(3, 6 * k + 3) = point.N[k] * L;
        B.block<4, 3>(7, 6 * k + 3) = point.N_s[k] * L;
    }
    return B;
}

// Derivative of x_dot by q (tangent): the rate of a quaternion goes along with its turning, p o b o omega / 4.
Rod::Dofs Rod::rates_by_q(const Point &point, const Element &nodes, const double *v) {
    Dofs B = Dofs::Zero();
    for (int k = 0; k < 3; ++k) {
        const Vector3d omega = Eigen::Map<const Vector3d>(v + 6 * k + 3);
        const Turning L = -0.25 * (nodes.p[k] * omega.transpose() + turning(nodes.p[k]) * skew(omega));
        B.block<4, 3>(3, 6 * k + 3) = point.N[k] * L;
        B.block<4, 3>(7, 6 * k + 3) = point.N_s[k] * L;
    }
    return B;
}

double Rod::energy(const double *x) const {
    double found = 0.0;
    for (int e = 0; e < elements(); ++e) {
        const Element nodes = element(e, x);
        for (int g = 0; g < 2; ++g) {
            const Point &point = points_[2 * e + g];
            const Vector6 strain = strains(at(point, nodes)) - point.e;
            found += 0.5 * point.weight * strain.dot(stiffness_ * strain);
        }
    }
    return found;
}

double Rod::damping_power(const double *x, const double *v) const {
    if (damping_ == 0.0) return 0.0;
    double found = 0.0;
    for (int e = 0; e < elements(); ++e) {
        const Element nodes = element(e, x);
        for (int g = 0; g < 2; ++g) {
            const Point &point = points_[2 * e + g];
            Strains at_point;
            strains(at(point, nodes), at_point);
            const Vector6 rate = at_point.G * (rates(point, nodes) * Eigen::Map<const Vector18>(v + 12 * e));
            found -= damping_ * point.weight * rate.dot(stiffness_ * rate);
        }
    }
    return found;
}

void Rod::section_forces(const double *x, const double *v, double *to) const {
    for (int e = 0; e < elements(); ++e) {
        const Element nodes = element(e, x);
        for (int g = 0; g < 2; ++g, to += 6) {
            const Point &point = points_[2 * e + g];
            Strains at_point;
            strains(at(point, nodes), at_point);
            const Vector6 rate = at_point.G * (rates(point, nodes) * Eigen::Map<const Vector18>(v + 12 * e));
            Eigen::Map<Vector6>{to} = stiffness_ * (at_point.e - point.e + damping_ * rate);
        }
    }
}

void Rod::subtract(const double *x, const double *v, double *tau, double *K, double *D, int stride) const {
    using Into = Eigen::Map<Matrix18, 0, Eigen::OuterStride<>>;
    for (int e = 0; e < elements(); ++e) {
        const Element nodes = element(e, x);
        Vector18 f = Vector18::Zero();
        Matrix18 by_q = Matrix18::Zero(), by_v = Matrix18::Zero();
        Vector4d on_p[3];  // derivative of the energy by the quaternions
        for (Vector4d &g : on_p) g.setZero();
        for (int g = 0; g < 2; ++g) {
            const Point &point = points_[2 * e + g];
            Strains s;
            strains(at(point, nodes), s);
            const Dofs B = rates(point, nodes);
            const Gradient CG = stiffness_ * s.G;
            Vector6 stress = stiffness_ * (s.e - point.e);
            Hessian A = s.G.transpose() * CG;
            if (damping_ > 0.0) {
                const Vector11 x_dot = B * Eigen::Map<const Vector18>(v + 12 * e);
                stress += damping_ * CG * x_dot;
                Gradient along;  // derivative of the rates of strain by x
                for (int k = 0; k < 6; ++k) along.row(k) = x_dot.transpose() * s.H[k];
                const Eigen::Matrix<double, 18, 11> viscous = damping_ * point.weight * (B.transpose() * A);
                by_v += viscous * B;
                by_q += viscous * rates_by_q(point, nodes, v + 12 * e);
                A += damping_ * CG.transpose() * along;
            }
            for (int k = 0; k < 6; ++k) A += stress[k] * s.H[k];
            const Vector11 force = point.weight * (s.G.transpose() * stress);
            f += B.transpose() * force;
            by_q += point.weight * (B.transpose() * (A * B));
            for (int k = 0; k < 3; ++k)
                on_p[k] += point.N[k] * force.segment<4>(3) + point.N_s[k] * force.tail<4>();
        }
        // the moments of the nodes turn with them: g . (p o b o a) / 4
        for (int k = 0; k < 3; ++k) {
            by_q.block<3, 3>(6 * k + 3, 6 * k + 3) += 0.5 * skew(f.segment<3>(6 * k + 3));
            by_q.block<3, 3>(6 * k + 3, 6 * k + 3).diagonal().array() -= 0.25 * on_p[k].dot(nodes.p[k]);
        }
        const int first = 12 * e;
        Eigen::Map<Vector18>{tau + first} -= f;
        Into(K + first * (stride + 1), Eigen::OuterStride<>(stride)) -= by_q;
        Into(D + first * (stride + 1), Eigen::OuterStride<>(stride)) -= by_v;
    }
}

}  // namespace nga
