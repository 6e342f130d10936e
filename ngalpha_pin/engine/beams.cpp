#include "beams.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace nga {
namespace {

using Four = std::array<double, 4>;

// Strains |t| and theta' = (t1 c2 - t2 c1) / |t|^2 of a curve with derivatives t and c, with gradients and Hessians by
// x = (t, c), from flexible/strains.py [16].
struct Strains {
    double value[2];
    Four G[2];
    std::array<Four, 4> H[2];

    explicit Strains(const Four &x) : value(), G(), H() {
        const double t1 = x[0], t2 = x[1], c1 = x[2], c2 = x[3];
        const double i = 1.0 / (t1 * t1 + t2 * t2), length = std::sqrt(t1 * t1 + t2 * t2);
        const double turning = (t1 * c2 - t2 * c1) * i, e1 = t1 * i, e2 = t2 * i, n1 = t1 / length, n2 = t2 / length;
        value[0] = length, value[1] = turning;
        G[0] = {n1, n2, 0.0, 0.0};
        G[1] = {c2 * i - 2.0 * turning * e1, -c1 * i - 2.0 * turning * e2, -e2, e1};
        auto &L = H[0], &T = H[1];
        L[0][0] = n2 * n2 / length, L[1][1] = n1 * n1 / length;
        L[0][1] = L[1][0] = -n1 * n2 / length;
        T[0][0] = -4.0 * c2 * i * e1 - 2.0 * turning * i + 8.0 * turning * e1 * e1;
        T[1][1] = 4.0 * c1 * i * e2 - 2.0 * turning * i + 8.0 * turning * e2 * e2;
        T[0][1] = T[1][0] = 2.0 * i * (c1 * e1 - c2 * e2) + 8.0 * turning * e1 * e2;
        T[0][2] = T[2][0] = 2.0 * e1 * e2;
        T[1][2] = T[2][1] = -i + 2.0 * e2 * e2;
        T[0][3] = T[3][0] = i - 2.0 * e1 * e1;
        T[1][3] = T[3][1] = -2.0 * e1 * e2;
    }
};

// (r', r'') of control points at one Gauss point
Four at_point(int functions, const double *first, const double *second, const double *x) {
    Four found{};
    for (int a = 0; a < functions; ++a) {
        found[0] += first[a] * x[2 * a], found[1] += first[a] * x[2 * a + 1];
        found[2] += second[a] * x[2 * a], found[3] += second[a] * x[2 * a + 1];
    }
    return found;
}

// adds B^T A B, where the rows of B take the coordinates of an element to (r', r'')
void add_matrix(int functions, const double *first, const double *second, const std::array<Four, 4> &A, double *to,
                long stride) {
    for (int b = 0; b < functions; ++b)
        for (int l = 0; l < 2; ++l) {
            Four column;
            for (int i = 0; i < 4; ++i) column[i] = A[i][l] * first[b] + A[i][2 + l] * second[b];
            double *place = to + (2 * b + l) * stride;
            for (int a = 0; a < functions; ++a) {
                place[2 * a] += first[a] * column[0] + second[a] * column[2];
                place[2 * a + 1] += first[a] * column[1] + second[a] * column[3];
            }
        }
}

}  // namespace

void add_internal_forces(const BeamSection &beam, const double *q, const double *v, double *f, double *K, double *D,
                         long stride) {
    const int n = beam.functions;
    for (int e = 0; e < beam.elements; ++e)
        for (int g = 0; g < beam.gauss; ++g) {
            const int point = e * beam.gauss + g;
            const double *first = beam.first + point * n, *second = beam.second + point * n;
            const Strains strain(at_point(n, first, second, q + 2 * e));
            const Four rate = beam.damping != 0.0 ? at_point(n, first, second, v + 2 * e) : Four{};
            Four force{};
            std::array<Four, 4> A{}, viscous{};
            for (int k = 0; k < 2; ++k) {
                const double stiffness = beam.stiffness[2 * point + k];
                const Four &G = strain.G[k];
                double stress = stiffness * (strain.value[k] - beam.reference[2 * point + k]), speed = 0.0;
                for (int i = 0; i < 4; ++i) speed += G[i] * rate[i];
                stress += beam.damping * stiffness * speed;
                for (int i = 0; i < 4; ++i) {
                    force[i] += stress * G[i];
                    for (int j = 0; j < 4; ++j) {
                        double bends = 0.0;
                        for (int l = 0; beam.damping != 0.0 && l < 4; ++l) bends += strain.H[k][l][j] * rate[l];
                        A[i][j] += stress * strain.H[k][i][j] + stiffness * G[i] * (G[j] + beam.damping * bends);
                        viscous[i][j] += beam.damping * stiffness * G[i] * G[j];
                    }
                }
            }
            for (int a = 0; a < n; ++a)
                for (int d = 0; d < 2; ++d) f[2 * (e + a) + d] += first[a] * force[d] + second[a] * force[2 + d];
            const long corner = 2 * e * (1 + stride);
            add_matrix(n, first, second, A, K + corner, stride);
            if (D != nullptr && beam.damping != 0.0) add_matrix(n, first, second, viscous, D + corner, stride);
        }
}

Beams::Beams(std::vector<BeamTable> beams, BeamPoints points, std::vector<double> load, std::vector<double> moments)
    : beams_(std::move(beams)), points_(std::move(points)), load_(std::move(load)), moments_(std::move(moments)) {
    turning_.assign(2 * points_.N.size(), 0.0), bend_.assign(2 * points_.N.size(), 0.0);
    hessian_.assign(4 * points_.first.size(), 0.0);
}

void Beams::move(const double *q, const double *v, const double *a, double *x, double *u, double *u_dot) {
    int at = 0;
    for (std::size_t p = 0; p < points_.first.size(); at += points_.functions[p++]) {
        const double *N = points_.N.data() + at, *dN = points_.dN.data() + at;
        double *X[3] = {x + 3 * p, u + 3 * p, u_dot + 3 * p}, t[2] = {}, t_dot[2] = {};
        const double *from[3] = {q + points_.first[p], v + points_.first[p], a + points_.first[p]};
        for (int o = 0; o < 3; ++o) std::fill(X[o], X[o] + 3, 0.0);
        for (int i = 0; i < points_.functions[p]; ++i)
            for (int d = 0; d < 2; ++d) {
                for (int o = 0; o < 3; ++o) X[o][d] += N[i] * from[o][2 * i + d];
                t[d] += dN[i] * q[points_.first[p] + 2 * i + d], t_dot[d] += dN[i] * v[points_.first[p] + 2 * i + d];
            }
        const double i = 1.0 / (t[0] * t[0] + t[1] * t[1]), e1 = t[0] * i, e2 = t[1] * i;
        const double mixed = 2.0 * e1 * e2, along = e2 * e2 - e1 * e1, bend[2] = {mixed * t_dot[0] + along * t_dot[1],
                                                                                  along * t_dot[0] - mixed * t_dot[1]};
        double *H = hessian_.data() + 4 * p;
        H[0] = mixed, H[1] = H[2] = along, H[3] = -mixed;
        X[0][2] = std::atan2(t[1], t[0]);
        X[2][2] = bend[0] * t_dot[0] + bend[1] * t_dot[1];
        for (int k = 0; k < points_.functions[p]; ++k)
            for (int d = 0; d < 2; ++d) {
                const double turn = dN[k] * (d == 0 ? -e2 : e1);
                turning_[2 * (at + k) + d] = turn, bend_[2 * (at + k) + d] = dN[k] * bend[d];
                X[1][2] += turn * v[points_.first[p] + 2 * k + d], X[2][2] += turn * a[points_.first[p] + 2 * k + d];
            }
    }
}

void Beams::dynamics(const double *q, const double *v, const double *a, double *residual, double *M, double *K, double *D,
                     long stride) const {
    for (int i = 0; i < size(); ++i) {
        residual[i] -= load_[i];
        for (int j = 0; j < size(); ++j) M[i + j * stride] = K[i + j * stride] = D[i + j * stride] = 0.0;
    }
    int at = 0;
    for (const BeamTable &beam : beams_) {
        const BeamSection section = beam.section();
        const int n = section.size(), w = 2 * beam.functions - 1;
        const long corner = at * (1 + stride);
        add_internal_forces(section, q + at, v + at, residual + at, K + corner, D + corner, stride);
        for (int j = 0; j < n; ++j)
            for (int i = std::max(0, j - w); i <= std::min(n - 1, j + w); ++i) {
                const double entry = beam.M[w + i - j + j * (2 * w + 1)];
                M[corner + i + j * stride] = entry;
                residual[at + i] += entry * a[at + j];
            }
        at += n;
    }
    for (std::size_t p = 0, first = 0; p < moments_.size(); first += points_.functions[p++]) {
        if (moments_[p] == 0.0) continue;
        const int count = 2 * points_.functions[p], place = points_.first[p];
        const double *dN = points_.dN.data() + first, *H = hessian_.data() + 4 * p;
        for (int i = 0; i < count; ++i) {
            residual[place + i] -= moments_[p] * turning_[2 * first + i];
            for (int j = 0; j < count; ++j)
                K[place + i + (place + j) * stride] -= moments_[p] * dN[i / 2] * dN[j / 2] * H[2 * (i % 2) + j % 2];
        }
    }
}

void Beams::find_span(const double *q, double *span) const {
    int at = 0;
    for (const BeamTable &beam : beams_) {
        const int n = beam.section().size();
        double largest = 0.0;
        for (int i = 0; i < n; ++i) largest = std::max(largest, std::abs(q[at + i]));
        std::fill(span + at, span + at + n, largest);
        at += n;
    }
}

void Beams::show(kernel::Shapes &shapes) const {
    shapes.count = points();
    shapes.first = points_.first.data(), shapes.functions = points_.functions.data();
    shapes.N = points_.N.data(), shapes.turning = turning_.data(), shapes.bend = bend_.data();
}

}  // namespace nga
