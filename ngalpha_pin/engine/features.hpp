// Local features of shapes, as collision/features.py describes them, and a packed row of two of them.
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "tolerances.hpp"

namespace nga {

using Vector = Eigen::Vector3d;
using Matrix = Eigen::Matrix3d;

constexpr double ALIGNED = 1 - 1e-10, ON = 1e-6, ON_SIDE = 1e-9;        // of collision/features.py
constexpr int SIDE = 19, NORMAL = 2 * SIDE, VANISHED = 2 * SIDE + 3, WIDTH = 2 * SIDE + 4;

struct Pose {
    Matrix R = Matrix::Identity();
    Vector p = Vector::Zero();

    Vector act(const Vector &x) const { return R * x + p; }
    Vector act_inverse(const Vector &x) const { return R.transpose() * (x - p); }
    Pose inverse() const { return {R.transpose(), -(R.transpose() * p)}; }
};

// A point c, straight directions in the columns of E (zero where there is none), an ellipsoid or a disc Q, a radius r.
struct Feature {
    Vector c = Vector::Zero();
    Eigen::Matrix<double, 3, 2> E = Eigen::Matrix<double, 3, 2>::Zero();
    Matrix Q = Matrix::Zero();
    double r = 0.0;

    int flat() const { return !E.col(0).isZero(0.0) + !E.col(1).isZero(0.0); }
};

// A feature without straight directions; `cut` is no corner of the shape, but a point between two of them.
struct Corner {
    Vector c;
    Matrix Q = Matrix::Zero();
    double r = 0.0;
    bool cut = false;

    Corner moved(const Pose &X) const {
        return {X.act(c), Q.isZero(0.0) ? Q : Matrix(X.R * Q * X.R.transpose()), r, cut};
    }
    // Its point with the outward unit normal m.
    Vector support(const Vector &m) const {
        const Vector Qm = Q * m;
        const double size = m.dot(Qm);
        const Vector x = c + r * m;
        return size > 0.0 ? Vector(x + Qm / std::sqrt(size)) : x;
    }
    Feature feature() const { return {c, Eigen::Matrix<double, 3, 2>::Zero(), Q, r}; }
};
using Corners = std::vector<Corner>;

// A flat side of a shape: its corners in order about the normal, none for a disc about the point of the feature, and
// neither corners nor a radius for an infinite plane.
struct Face {
    Feature feature;
    Vector normal;
    std::vector<Vector> corners;
    double radius = 0.0;
};

inline void tangents(const Vector &n, Vector &first, Vector &second) {
    int least = 0;
    for (int i = 1; i < 3; ++i)
        if (std::abs(n[i]) < std::abs(n[least])) least = i;
    Vector e = Vector::Zero();
    e[least] = 1.0;
    first = e - e.dot(n) * n;
    first /= first.norm();
    second = n.cross(first);
}

inline Feature point(const Vector &c, double r) { return {c, Eigen::Matrix<double, 3, 2>::Zero(), Matrix::Zero(), r}; }

inline Feature line(const Vector &c, const Vector &direction, double r) {
    Feature found = point(c, r);
    found.E.col(0) = direction;
    return found;
}

inline Feature plane(const Vector &c, const Vector &normal, double r) {
    Feature found = point(c, r);
    Vector first, second;
    tangents(normal, first, second);
    found.E.col(0) = first, found.E.col(1) = second;
    return found;
}

inline Feature rim(const Vector &c, const Vector &axis, double radius, double r) {
    Feature found = point(c, r);
    found.Q = radius * radius * (Matrix::Identity() - axis * axis.transpose());
    return found;
}

inline Feature moved(const Feature &f, const Pose &X) {
    return {X.act(f.c), X.R * f.E, X.R * f.Q * X.R.transpose(), f.r};
}

inline Face moved(const Face &face, const Pose &X) {
    Face found{moved(face.feature, X), X.R * face.normal, {}, face.radius};
    for (const Vector &x : face.corners) found.corners.push_back(X.act(x));
    return found;
}

// Two features in the frames of their joints and the normal from A to B in the frame of A.
struct Row {
    std::array<double, WIDTH> x;

    Row() { x.fill(0.0); }
    explicit Row(const double *from) { std::copy(from, from + WIDTH, x.begin()); }
    Row(const Feature &a, const Feature &b, const Vector &n) {
        side(0, a), side(SIDE, b);
        for (int i = 0; i < 3; ++i) x[NORMAL + i] = n[i];
        x[VANISHED] = 0.0;
    }
    Vector place(int start) const { return Eigen::Map<const Vector>(x.data() + start); }
    Vector normal() const { return place(NORMAL); }
    bool same(const Row &other) const { return std::memcmp(x.data(), other.x.data(), sizeof x) == 0; }
    bool is_face(int start) const { return x[start + 4] != 0.0 || x[start + 6] != 0.0 || x[start + 8] != 0.0; }
    // E and Q lie by rows; Q is symmetric.
    Eigen::Matrix<double, 3, 2> E(int start) const {
        return Eigen::Map<const Eigen::Matrix<double, 3, 2, Eigen::RowMajor>>(x.data() + start + 3);
    }
    Matrix Q(int start) const { return Eigen::Map<const Matrix>(x.data() + start + 9); }

private:
    void side(int start, const Feature &f) {
        for (int i = 0; i < 3; ++i) {
            x[start + i] = f.c[i];
            for (int j = 0; j < 2; ++j) x[start + 3 + 2 * i + j] = f.E(i, j);
            for (int j = 0; j < 3; ++j) x[start + 9 + 3 * i + j] = f.Q(i, j);
        }
        x[start + 18] = f.r;
    }
};

// Gap of a packed row along its normal, for the pose X of joint B in joint A [m].
inline double gap_along_normal(const Row &row, const Pose &X) {
    const Vector n = row.normal(), m = -(X.R.transpose() * n);
    double gap = 0.0;
    for (int start : {0, SIDE}) {
        const Vector &direction = start ? m : n;
        const Vector c = start ? X.act(row.place(start)) : row.place(start);
        const double reach = row.x[start + 18] + std::sqrt(std::max(direction.dot(row.Q(start) * direction), 0.0));
        gap += (start ? n.dot(c) : -n.dot(c)) - reach;
    }
    return gap;
}

}  // namespace nga
