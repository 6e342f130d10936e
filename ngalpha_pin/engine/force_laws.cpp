#include "force_laws.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "kernel/vectors.h"

namespace nga {
namespace {

void check(std::size_t size, std::size_t wanted) {
    if (size != wanted) throw std::invalid_argument("a force law has an array of another size than its scene");
}

// A point of a joint in the world, and the pose of that joint.
void put(const Mechanism &at, int joint, const double *point, double *x) {
    apply(at.rotation(joint), point, x);
    for (int e = 0; e < 3; ++e) x[e] += at.translation(joint)[e];
}

// How coordinate l moves a point of the world that goes along with its joint.
void way(const double *J, const double *x, double *P) {
    for (int e = 0; e < 3; ++e) P[e] = J[e];
    add_cross(J + 3, x, P);
}

const double SMALL = 0.05;  // half angle below which 1 - h cot h loses more digits than its series of three terms

// The rotation vector theta of a turn from a rest, both unit quaternions (x, y, z, w), the shorter way, and its
// derivative by the angular velocity in the body, 1 + [theta] / 2 + c [theta]^2, by columns.
void turn_from(const double *rest, const double *p, double *theta, double *slope) {
    double x[3], w = rest[3] * p[3] + dot(rest, p);
    cross(p, rest, x);
    for (int e = 0; e < 3; ++e) x[e] += rest[3] * p[e] - p[3] * rest[e];
    const double sign = w < 0.0 ? -1.0 : 1.0, sine = std::sqrt(dot(x, x)), half = std::atan2(sine, w *= sign);
    for (int e = 0; e < 3; ++e) theta[e] = sign * x[e] * (sine > 0.0 ? 2.0 * half / sine : 2.0);
    const double square = half * half;
    const double c = half < SMALL ? 1.0 / 12.0 + square / 180.0 + square * square / 1890.0
                                  : (1.0 - half * w / sine) / (4.0 * square);
    for (int l = 0; l < 3; ++l) {
        const int next = (l + 1) % 3, last = (l + 2) % 3;
        for (int i = 0; i < 3; ++i) slope[3 * l + i] = c * theta[i] * theta[l];
        slope[3 * l + l] += 1.0 - 4.0 * square * c;
        slope[3 * l + next] += 0.5 * theta[last], slope[3 * l + last] -= 0.5 * theta[next];
    }
}

// A vector in the axes of a body with the unit quaternion p.
void into(const double *p, const double *x, double *own) {
    double t[3], u[3];
    cross(x, p, t);
    for (int e = 0; e < 3; ++e) t[e] *= 2.0;
    cross(t, p, u);
    for (int e = 0; e < 3; ++e) own[e] = x[e] + p[3] * t[e] + u[e];
}

}  // namespace

ForceLaws::ForceLaws(const kernel::Live &live, const Mechanism &at, std::vector<double> before)
    : live_(live), at_(at), nv_(at.nv_tree()), before_(std::move(before)) {
    check(before_.size(), static_cast<std::size_t>(nv_) * nv_);
}

void ForceLaws::add_joint_spring(std::vector<double> row, std::vector<int> places, std::vector<double> factors,
                                 double period) {
    check(row.size(), nv_), check(places.size(), std::isinf(period) ? factors.size() : 2), check(factors.size() > 0, 1);
    joint_springs_.push_back({std::move(row), std::move(places), std::move(factors), period});
}

void ForceLaws::add_pose_spring(int q, int v, bool moves) {
    if (q < 0 || v < 0 || v + (moves ? 6 : 3) > nv_) throw std::invalid_argument("a joint is not among the velocities");
    pose_springs_.push_back({q, v, moves});
}

void ForceLaws::add_spring(int a, int b, std::vector<double> point_a, std::vector<double> point_b, std::vector<double> on_a,
                           std::vector<double> on_b) {
    check(point_a.size(), 3), check(point_b.size(), 3), check(on_a.size(), nv_), check(on_b.size(), nv_);
    springs_.push_back({a, b, std::move(point_a), std::move(point_b), std::move(on_a), std::move(on_b)});
}

void ForceLaws::add_wrench(int joint, std::vector<double> rotation, std::vector<double> translation, std::vector<double> on,
                           bool local) {
    check(rotation.size(), 9), check(translation.size(), 3), check(on.size(), nv_);
    wrenches_.push_back({joint, std::move(rotation), std::move(translation), std::move(on), local});
}

void ForceLaws::add_rod(const Rod &rod, int q, int v) {
    if (q < 0 || v < 0 || v + 6 * rod.nodes() > nv_) throw std::invalid_argument("a rod is not among the velocities");
    rods_.push_back({rod, q, v});
}

void ForceLaws::add_cable(const Cable &cable, int q, int v) {
    if (q < 0 || v < 0 || v + 3 * cable.nodes() > nv_) throw std::invalid_argument("a cable is not among the velocities");
    cables_.push_back({cable, q, v});
}

void ForceLaws::set(std::vector<double> numbers) {
    check(numbers.size(), count());
    numbers_ = std::move(numbers);
}

void ForceLaws::add(const Eigen::VectorXd &q, const Eigen::VectorXd &v, double *tau, double *K, double *D) const {
    check(numbers_.size(), count());
    const Sums to{q, v, tau, K, D};
    const double *numbers = numbers_.data();
    for (const JointSpring &spring : joint_springs_) add_one(spring, numbers, to), numbers += 4;
    for (const PoseSpring &spring : pose_springs_) add_one(spring, numbers, to), numbers += 8;
    for (const Spring &spring : springs_) add_one(spring, numbers, to), numbers += 3;
    for (const Wrench &wrench : wrenches_) add_one(wrench, numbers, to), numbers += 6;
    add_all(rods_, to), add_all(cables_, to);
}

template <class Strand>
void ForceLaws::add_all(const std::vector<Placed<Strand>> &strands, const Sums &to) const {
    for (const Placed<Strand> &at : strands) {
        const int corner = at.v * (nv_ + 1);
        at.strand.subtract(to.q.data() + at.q, to.v.data() + at.v, to.tau + at.v, to.K + corner, to.D + corner, nv_);
    }
}

void ForceLaws::add_one(const JointSpring &spring, const double *numbers, const Sums &to) const {
    const double stiffness = numbers[0], damping = numbers[3];
    const double middle = 0.5 * (numbers[1] + numbers[2]), half = 0.5 * (numbers[2] - numbers[1]);
    const std::vector<int> &at = spring.places;
    double value = 0.0, rate = 0.0;
    if (std::isinf(spring.period))
        for (std::size_t i = 0; i < at.size(); ++i) value += spring.factors[i] * to.q[at[i]];
    else
        value = spring.factors[0] * std::atan2(to.q[at[1]], to.q[at[0]]);
    double away = value - middle;
    if (!std::isinf(spring.period)) away -= spring.period * std::nearbyint(away / spring.period);
    const double beyond = std::max(std::abs(away) - half, 0.0), stretch = away < 0.0 ? -beyond : beyond;
    for (int i = 0; i < nv_; ++i) rate += spring.row[i] * to.v[i];
    const double force = stiffness * stretch + damping * rate;
    const double slope = stretch != 0.0 || numbers[1] == numbers[2] ? stiffness : 0.0;
    for (int l = 0; l < nv_; ++l) {
        if (spring.row[l] == 0.0) continue;
        to.tau[l] -= force * spring.row[l];
        for (int i = 0; i < nv_; ++i) {
            const double square = spring.row[i] * spring.row[l];
            to.K[l * nv_ + i] -= slope * square, to.D[l * nv_ + i] -= damping * square;
        }
    }
}

void ForceLaws::add_one(const PoseSpring &spring, const double *numbers, const Sums &to) const {
    const double stiffness = numbers[0], *rest = numbers + 1, *at = to.q.data() + spring.q;
    const int turns = spring.v + (spring.moves ? 3 : 0);
    double theta[3], slope[9];
    turn_from(rest + 3, at + (spring.moves ? 3 : 0), theta, slope);
    for (int l = 0; l < 3; ++l) {
        to.tau[turns + l] -= stiffness * theta[l];
        for (int i = 0; i < 3; ++i) to.K[(turns + l) * nv_ + turns + i] -= stiffness * slope[3 * l + i];
    }
    if (!spring.moves) return;
    double way[3], own[3];
    for (int e = 0; e < 3; ++e) way[e] = at[e] - rest[e];
    into(at + 3, way, own);
    for (int l = 0; l < 3; ++l) {
        const int next = (l + 1) % 3, last = (l + 2) % 3;
        to.tau[spring.v + l] -= stiffness * own[l];
        to.K[(spring.v + l) * nv_ + spring.v + l] -= stiffness;
        to.K[(turns + l) * nv_ + spring.v + next] -= stiffness * own[last];
        to.K[(turns + l) * nv_ + spring.v + last] += stiffness * own[next];
    }
}

// Derivative of J_i . F by coordinate l with the wrench F held, where l stands before i in the tree.
double ForceLaws::turning(int i, int l, const double *J, const double *F) const {
    if (before_[i * nv_ + l] == 0.0) return 0.0;
    double by_l[6] = {0};
    add_force_cross(J + 6 * l, F, by_l);
    return -dot6(J + 6 * i, by_l);
}

void ForceLaws::add_one(const Spring &spring, const double *numbers, const Sums &to) const {
    const double *J = live_.J, *dJ = live_.dJ, *dAdv = live_.dAdv;
    double a[3], c[3], e[3], F[6], V_a[6] = {0}, V_b[6] = {0}, relative[6], c_dot[3], e_dot[3], G[6] = {0}, mixed[3];
    put(at_, spring.a, spring.point_a.data(), a);
    put(at_, spring.b, spring.point_b.data(), c);
    for (int i = 0; i < 3; ++i) e[i] = c[i] - a[i];
    const double length = std::max(std::sqrt(dot(e, e)), 1e-300);
    for (int i = 0; i < 3; ++i) F[i] = e[i] /= length;
    cross(c, e, F + 3);
    for (int l = 0; l < nv_; ++l)
        for (int i = 0; i < 6; ++i) {
            if (spring.on_a[l] != 0.0) V_a[i] += J[6 * l + i] * to.v[l];
            if (spring.on_b[l] != 0.0) V_b[i] += J[6 * l + i] * to.v[l];
        }
    for (int i = 0; i < 6; ++i) relative[i] = V_b[i] - V_a[i];
    way(relative, c, c_dot);
    const double rate = dot6(F, relative), along = dot(e, c_dot);
    const double force = -numbers[0] * (length - numbers[1]) - numbers[2] * rate;
    // of the rate by the position: a wrench on J, as in the rows of frames
    for (int i = 0; i < 3; ++i) e_dot[i] = (c_dot[i] - along * e[i]) / length;
    cross(e, relative + 3, mixed);
    for (int i = 0; i < 3; ++i) mixed[i] += e_dot[i];
    add_force_cross(V_b, F, G);
    ::add_wrench(mixed, c, G);
    for (int l = 0; l < nv_; ++l) {
        const double sign = spring.on_b[l] - spring.on_a[l], *J_l = J + 6 * l;
        const double W_l = sign * dot6(F, J_l), X_l = sign * (dot6(G, J_l) + dot6(F, dAdv + 6 * l) - dot6(F, dJ + 6 * l));
        to.tau[l] += force * W_l;
        // the direction of the force, which goes along with both ends
        double P_a[3], P_b[3], change[3], dF[6];
        way(J_l, a, P_a), way(J_l, c, P_b);
        for (int i = 0; i < 3; ++i) P_a[i] *= spring.on_a[l], P_b[i] *= spring.on_b[l], change[i] = P_b[i] - P_a[i];
        const double longer = dot(change, e);
        for (int i = 0; i < 3; ++i) dF[i] = (change[i] - longer * e[i]) / length;
        cross(P_b, e, dF + 3);
        add_cross(c, dF, dF + 3);
        const double by_q = numbers[0] * W_l + numbers[2] * X_l, by_v = numbers[2] * W_l;
        for (int i = 0; i < nv_; ++i) {
            const double on = spring.on_b[i] - spring.on_a[i];
            if (on == 0.0) continue;
            const double W_i = on * dot6(F, J + 6 * i);
            to.D[l * nv_ + i] -= W_i * by_v;
            to.K[l * nv_ + i] += force * on * (dot6(J + 6 * i, dF) + turning(i, l, J, F)) - W_i * by_q;
        }
    }
}

void ForceLaws::add_one(const Wrench &wrench, const double *numbers, const Sums &to) const {
    const double *J = live_.J, *R = at_.rotation(wrench.joint);
    double c[3], f[3], m[3], own[3], F[6];
    put(at_, wrench.joint, wrench.translation.data(), c);
    std::copy(numbers, numbers + 3, f), std::copy(numbers + 3, numbers + 6, m);
    if (wrench.local) {
        apply(wrench.rotation.data(), numbers, own), apply(R, own, f);
        apply(wrench.rotation.data(), numbers + 3, own), apply(R, own, m);
    }
    std::copy(f, f + 3, F), std::copy(m, m + 3, F + 3);
    add_cross(c, f, F + 3);
    for (int l = 0; l < nv_; ++l) {
        if (wrench.on[l] == 0.0) continue;
        const double *J_l = J + 6 * l;
        double P[3], dF[6] = {0};
        to.tau[l] += dot6(J_l, F);
        way(J_l, c, P);
        if (wrench.local) {
            cross(J_l + 3, f, dF);
            add_cross(c, dF, dF + 3), add_cross(J_l + 3, m, dF + 3);
        }
        add_cross(P, f, dF + 3);
        for (int i = 0; i < nv_; ++i)
            if (wrench.on[i] != 0.0) to.K[l * nv_ + i] += dot6(J + 6 * i, dF) + turning(i, l, J, F);
    }
}

}  // namespace nga
