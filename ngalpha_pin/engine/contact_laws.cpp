#include "contact_laws.hpp"

#include <algorithm>
#include <cmath>

namespace nga {
namespace {

// relative distance from the edge of the cone within which friction sticks: rounding of what lies on it
constexpr double EDGE = 1.0 + 1e-9;

double norm(const double *x, int n) {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += x[i] * x[i];
    return std::sqrt(sum);
}

// What holding and regularising make of one kinematic row y = 0: dP = -(r + dy / s) / regular.
struct Row {
    double scale, regular;
    Row(double s, const Held &held)
        : scale(s * (1.0 + held.hold)), regular((held.hold + held.regular) / (1.0 + held.hold)) {}
    void vanish(int i, double y, double *r, Response &response) const {
        r[i] = y / scale;
        response.p[i] = -r[i] / regular;
        response.C[i][i] = 1.0 / (regular * scale);
    }
};

// Friction that slips: P_F = R u with u = t / |t|, t = P_F - y_F / s.
void slip(const Group &group, const Row &row, const double *t, double length, double R, const double *P, double *r,
          Response &response) {
    const int m = group.rows - 1;
    const double part = R / length, across = 1.0 - part + row.regular * part;
    double u[MOST_ROWS - 1], along = 0.0;
    for (int i = 0; i < m; ++i) {
        u[i] = t[i] / length;
        r[i + 1] = P[i + 1] - R * u[i];
        along += u[i] * r[i + 1];
    }
    for (int i = 0; i < m; ++i) {
        response.p[i + 1] = u[i] * (group.mu * response.p[0] - along) - (r[i + 1] - u[i] * along) / across;
        response.C[i + 1][0] = group.mu * u[i] * response.C[0][0];
        for (int j = 0; j < m; ++j)
            response.C[i + 1][j + 1] = part / (row.scale * across) * ((i == j) - u[i] * u[j]);
    }
}

char linearise_bounded(const Group &group, double P, double y, const Row &row, double *r, Response &response) {
    const double trial = P - y / row.scale;
    if (trial >= group.lower && trial <= group.upper) {
        row.vanish(0, y, r, response);
        return 1;
    }
    r[0] = P - (trial < group.lower ? group.lower : group.upper);
    response.p[0] = -r[0];
    return trial < group.lower ? 2 : 3;
}

char linearise_contact(const Group &group, const double *P, const double *y, const Held &held, double *r,
                       Response &response) {
    const Row normal(group.s_N, held), friction(group.s_F, held);
    const int m = group.rows - 1;
    if (P[0] - y[0] / normal.scale <= 0.0) {  // open
        for (int i = 0; i <= m; ++i) {
            r[i] = P[i];
            response.p[i] = -P[i];
        }
        return 0;
    }
    normal.vanish(0, y[0], r, response);
    if (group.kind == Kind::tied) {
        for (int i = 0; i < m; ++i) {
            const double c = group.mu * group.direction[i];
            r[i + 1] = P[i + 1] - c * P[0];
            response.p[i + 1] = c * response.p[0] - r[i + 1];
            response.C[i + 1][0] = c * response.C[0][0];
        }
        return 1;
    }
    double t[MOST_ROWS - 1];
    for (int i = 0; i < m; ++i) t[i] = P[i + 1] - y[i + 1] / friction.scale;
    const double length = norm(t, m), R = group.mu * std::max(P[0], 0.0);
    if (length > EDGE * R) {
        slip(group, friction, t, length, R, P, r, response);
        return 2;
    }
    for (int i = 1; i <= m; ++i) friction.vanish(i, y[i], r, response);
    return 1;
}

}  // namespace

char linearise(const Group &group, const double *P, const double *y, const Held &held, Response &response,
               Measure &measure) {
    double r[MOST_ROWS], held_y[MOST_ROWS];
    response = Response{};
    for (int i = 0; i < group.rows; ++i) {
        held_y[i] = y[i];
        if (held.hold > 0.0) held_y[i] += held.hold * (i ? group.s_F : group.s_N) * (P[i] - held.Z[group.first + i]);
    }
    const char found = group.kind == Kind::bounded
                           ? linearise_bounded(group, P[0], held_y[0], Row(group.s_N, held), r, response)
                           : linearise_contact(group, P, held_y, held, r, response);
    for (int i = 0; i < group.rows; ++i) {
        const double root = std::sqrt(i ? group.s_F : group.s_N);
        const double residual = std::abs(r[i]) * root;
        if (!(residual <= measure.residual)) measure.residual = residual;  // what is not a number stays
        measure.size = std::max(measure.size, std::abs(P[i]) * root);
    }
    return found;
}

void prox_step(const Group &group, const double *G, const double *y, double *P) {
    if (group.kind == Kind::bounded) {
        P[0] = std::min(std::max(P[0] - y[0] / group.s_N, group.lower), group.upper);
        return;
    }
    const double before = P[0];
    P[0] = std::max(0.0, before - y[0] / group.s_N);
    const int m = group.rows - 1;
    if (group.kind == Kind::tied) {
        for (int i = 0; i < m; ++i) P[i + 1] = group.mu * group.direction[i] * P[0];
        return;
    }
    for (int i = 1; i <= m; ++i) P[i] -= (y[i] + G[i * MOST_ROWS] * (P[0] - before)) / group.s_F;
    const double length = norm(P + 1, m), R = group.mu * P[0];
    if (length > R)
        for (int i = 1; i <= m; ++i) P[i] *= R / length;
}

}  // namespace nga
