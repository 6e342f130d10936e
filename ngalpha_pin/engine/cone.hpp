// The second-order cone x_0 >= |x_1..|, and the scaling of Nesterov and Todd between two points of its interior.
//
// L. Vandenberghe: The CVXOPT linear and quadratic cone program solvers, 2010, sections 4 and 5.
#pragma once
#include <algorithm>
#include <cmath>

#include "contact_laws.hpp"

namespace nga {

// A point of a cone of dimension n; the cone of dimension 1 is x_0 >= 0.
struct ConePoint {
    double x[MOST_ROWS] = {0.0, 0.0, 0.0, 0.0};

    double tail(int n) const {
        double sum = 0.0;
        for (int i = 1; i < n; ++i) sum += x[i] * x[i];
        return std::sqrt(sum);
    }
    // x_0^2 - |x_1..|^2, without cancellation
    double determinant(int n) const { return (x[0] - tail(n)) * (x[0] + tail(n)); }
    double dot(const ConePoint &other, int n) const {
        double sum = 0.0;
        for (int i = 0; i < n; ++i) sum += x[i] * other.x[i];
        return sum;
    }
    // largest step along d inside of the cone, at most `most`
    double reach(const ConePoint &d, int n, double most) const {
        if (n == 1) return d.x[0] < 0.0 ? std::min(most, -x[0] / d.x[0]) : most;
        double a = d.x[0] * d.x[0], b = x[0] * d.x[0];
        for (int i = 1; i < n; ++i) a -= d.x[i] * d.x[i], b -= x[i] * d.x[i];
        const double c = determinant(n), root = b * b - a * c;
        // the first root of a s^2 + 2 b s + c that is positive, and where x_0 itself vanishes
        if (root >= 0.0) {
            const double q = -(b + (b < 0.0 ? -1.0 : 1.0) * std::sqrt(root));
            for (double s : {q != 0.0 ? c / q : -1.0, a != 0.0 ? q / a : -1.0})
                if (s > 0.0) most = std::min(most, s);
        }
        return d.x[0] < 0.0 ? std::min(most, -x[0] / d.x[0]) : most;
    }
};

// Jordan product and its inverse: a \ b is the c with a o c = b.
inline ConePoint product(const ConePoint &a, const ConePoint &b, int n) {
    ConePoint c;
    c.x[0] = a.dot(b, n);
    for (int i = 1; i < n; ++i) c.x[i] = a.x[0] * b.x[i] + b.x[0] * a.x[i];
    return c;
}

inline ConePoint quotient(const ConePoint &a, const ConePoint &b, int n) {
    ConePoint c;
    double along = 0.0;
    for (int i = 1; i < n; ++i) along += a.x[i] * b.x[i];
    c.x[0] = n == 1 ? b.x[0] / a.x[0] : (a.x[0] * b.x[0] - along) / a.determinant(n);
    for (int i = 1; i < n; ++i) c.x[i] = (b.x[i] - c.x[0] * a.x[i]) / a.x[0];
    return c;
}

// The symmetric W with W z = W^-1 x = lambda.
struct Scaling {
    int n = 1;
    double W[MOST_ROWS][MOST_ROWS], square[MOST_ROWS][MOST_ROWS], inverse[MOST_ROWS][MOST_ROWS];
    double w[MOST_ROWS], square_size = 1.0;
    ConePoint lambda;

    void set(const ConePoint &x, const ConePoint &z, int dimension) {
        n = dimension;
        if (n == 1) {
            W[0][0] = std::sqrt(x.x[0] / z.x[0]);
            square[0][0] = x.x[0] / z.x[0];
            inverse[0][0] = 1.0 / W[0][0];
        } else {
            const double size_x = std::sqrt(x.determinant(n)), size_z = std::sqrt(z.determinant(n));
            const double cosine = x.dot(z, n) / (size_x * size_z), gamma = std::sqrt((1.0 + cosine) / 2.0);
            double v[MOST_ROWS];
            for (int i = 0; i < n; ++i) w[i] = (x.x[i] / size_x + (i ? -1.0 : 1.0) * z.x[i] / size_z) / (2.0 * gamma);
            for (int i = 0; i < n; ++i) v[i] = (w[i] + (i == 0)) / std::sqrt(2.0 * (w[0] + 1.0));
            const double beta = std::sqrt(size_x / size_z);
            square_size = size_x / size_z;
            for (int i = 0; i < n; ++i)
                for (int j = 0; j < n; ++j) {
                    const double reflect = i != j ? 0.0 : i ? -1.0 : 1.0, sign = (i == 0) == (j == 0) ? 1.0 : -1.0;
                    W[i][j] = beta * (2.0 * v[i] * v[j] - reflect);
                    inverse[i][j] = (2.0 * sign * v[i] * v[j] - reflect) / beta;
                    square[i][j] = beta * beta * (2.0 * w[i] * w[j] - reflect);
                }
        }
        lambda = times(W, z);
    }

    ConePoint times(const double (&A)[MOST_ROWS][MOST_ROWS], const ConePoint &y) const {
        ConePoint out;
        for (int i = 0; i < n; ++i)
            for (int j = 0; j < n; ++j) out.x[i] += A[i][j] * y.x[j];
        return out;
    }
};

}  // namespace nga
