/* Twin of contact/point_rows.py: gaps, rows with their rates, and the derivatives that the Newton matrix needs. */
#include <math.h>
#include <string.h>

#include "kernel.h"
#include "vectors.h"

/* Gap of a contact; of a limit it is all that there is. c: centre in the world; n: normal in the frame of A, of features in the world; curvature: that of the surface, 0 of a plane */
static double gap(const Plan *p, const Table *t, const Index *at, int i, double *c, double *n, double *curvature)
{
    if (at->limit_q[i] >= 0) return t->limit_sign[i] * (p->live->q[at->limit_q[i]] - t->limit_value[i]);
    if (at->slot[i] >= 0) return feature_gap(p, at, i, n);
    const double *R_b = p->poses[2 * at->body_b[i]], *p_b = p->poses[2 * at->body_b[i] + 1];
    const double *R_a = p->poses[2 * at->body_a[i]], *p_a = p->poses[2 * at->body_a[i] + 1];
    double from_a[3], x[3], G;
    apply(R_b, t->point + 3 * i, c);
    for (int e = 0; e < 3; e++) c[e] += p_b[e];
    for (int e = 0; e < 3; e++) from_a[e] = c[e] - p_a[e];
    for (int e = 0; e < 3; e++) x[e] = dot(R_a + 3 * e, from_a);
    if (!at->curved[i]) {
        memcpy(n, t->normal + 3 * i, 3 * sizeof(double));
        *curvature = 0.0;
        return dot(n, x) - t->offset[i] - t->radius[i];
    }
    const double *axis = t->axis + 3 * i;
    double arm[3];
    for (int e = 0; e < 3; e++) x[e] -= t->centre[3 * i + e];
    const double along = dot(axis, x);
    for (int e = 0; e < 3; e++) arm[e] = x[e] - along * axis[e];
    const double rho = sqrt(dot(arm, arm));
    /* on the axis of a hollow shape there is no normal; the contact is far from closing there */
    *curvature = t->side[i] / bigger(rho, 1e-12 * t->surface_radius[i]);
    for (int e = 0; e < 3; e++) n[e] = *curvature * arm[e];
    G = t->side[i] * (rho - t->surface_radius[i]);
    /* past the end of a cylinder its lateral surface ends, and the contact is open */
    const double beyond = fabs(along) - t->half_length[i];
    if (beyond > 0) G = bigger(G, t->radius[i] + beyond);
    return G - t->radius[i];
}

/* gaps, and unless it is NULL the normals in the world, zero of limits */
EXPORT void nga_find_gaps(const Plan *p, double *g_N, double *normals)
{
    const Table t = table_of(p);
    const Index at = index_of(p);
    for (int i = 0; i < p->k; i++) {
        double c[3], n[3] = {0.0, 0.0, 0.0}, curvature;
        g_N[i] = gap(p, &t, &at, i, c, n, &curvature);
        if (normals == NULL) continue;
        if (at.slot[i] < 0 && at.limit_q[i] < 0)
            apply(p->poses[2 * at.body_a[i]], n, normals + 3 * i);
        else
            memcpy(normals + 3 * i, n, sizeof n);
    }
}

/* velocity of a body where c is, from its twist at the origin of the world */
static void velocity_at(const double *V, const double *c, double *velocity)
{
    cross(V + 3, c, velocity);
    for (int e = 0; e < 3; e++) velocity[e] += V[e];
}

/* gaps and their rates alone; V: room for the twists of the bodies, 6 nb */
EXPORT void nga_find_rates(const Plan *p, const double *v, double *V, double *g_N, double *rate)
{
    const Table t = table_of(p);
    const Index at = index_of(p);
    memset(V, 0, 6 * (size_t)p->nb * sizeof(double));
    for (int b = 0; b < p->nb; b++)
        for (int c = 0; c < p->nu; c++)
            if (t.support[b * p->nu + c] != 0.0)
                for (int e = 0; e < 6; e++) V[6 * b + e] += p->live->J[6 * c + e] * v[c];
    for (int i = 0; i < p->k; i++) {
        double c[3], n[3], normal[3], curvature, of_b[3], of_a[3];
        g_N[i] = gap(p, &t, &at, i, c, n, &curvature);
        if (at.limit_q[i] >= 0) {
            rate[i] = t.limit_sign[i] * v[at.limit_dof[i]];
            continue;
        }
        apply(p->poses[2 * at.body_a[i]], n, normal);
        velocity_at(V + 6 * at.body_b[i], c, of_b);
        velocity_at(V + 6 * at.body_a[i], c, of_a);
        rate[i] = dot(normal, of_b) - dot(normal, of_a);
    }
}

/* gap, frame and curvature of contact i */
static void surface(const Plan *p, const Table *t, const Index *at, int i, Rows *r)
{
    const double *R_a = p->poses[2 * at->body_a[i]], *axis = t->axis + 3 * i;
    double *c = r->c + 3 * i, *normal = r->normals + 3 * i;
    double n[3], curvature, frame[6];
    r->g_N[i] = gap(p, t, at, i, c, n, &curvature);
    apply(R_a, n, normal);
    memcpy(frame, t->tangent + 6 * i, sizeof frame);
    if (at->curved[i]) {
        double A[9], *bend = r->bend + 9 * i; /* R_a (projector - n n^T) R_a^T, from the world vectors */
        cross(t->tangent + 6 * i, n, frame);
        const double size = bigger(sqrt(dot(frame, frame)), 1e-300);
        for (int e = 0; e < 3; e++) frame[e] /= size;
        cross(n, frame, frame + 3);
        apply(R_a, axis, A);
        for (int e = 0; e < 3; e++)
            for (int f = 0; f < 3; f++)
                bend[3 * e + f] = curvature * ((e == f) - A[e] * A[f] - normal[e] * normal[f]);
    }
    memcpy(r->directions + 3 * i, normal, 3 * sizeof(double));
    for (int f = at->first_F[i]; f < at->first_F[i + 1]; f++) {
        double *d = r->directions + 3 * (p->k + f), *q = r->q + 3 * (p->k + f), arm[3];
        if (at->kind_F[f] < 2) {
            apply(R_a, frame + 3 * at->kind_F[f], d);
            cross(normal, d, arm);
            for (int e = 0; e < 3; e++) q[e] = -t->radius[i] * arm[e];
        } else
            for (int e = 0; e < 3; e++) q[e] = t->drill_F[f] * normal[e];
    }
}

/* place of row number `row` of contact i: 0 is the normal, then friction */
static int place(const Plan *p, const Index *at, int i, int row)
{
    return row == 0 ? i : p->k + at->first_F[i] + row - 1;
}

/* motion of contact i relative to its surface, and what the turning of everything adds to the accelerations (bias) */
static void motion(const Plan *p, const Index *at, int i, Rows *r, double *bias)
{
    const double *V_b = r->V + 6 * at->body_b[i], *V_a = r->V + 6 * at->body_a[i];
    double V[6], acceleration[6] = {0}, *omega = r->omega + 3 * i, *c_dot = r->c_dot + 3 * i;
    for (int e = 0; e < 6; e++) V[e] = V_b[e] - V_a[e];
    memcpy(omega, V + 3, 3 * sizeof(double));
    memcpy(c_dot, V, 3 * sizeof(double));
    add_cross(omega, r->c + 3 * i, c_dot);
    if (at->moving[i]) {
        cross(V_a + 3, V, acceleration);
        add_cross(V_a, V + 3, acceleration);
        cross(V_a + 3, V + 3, acceleration + 3);
    }
    const int rows = 1 + at->first_F[i + 1] - at->first_F[i];
    for (int row = 0; row < rows; row++) {
        const int u = place(p, at, i, row);
        const double *d = r->directions + 3 * u;
        double *F = r->wrench + 6 * u, *turn = r->turn + 3 * u;
        memcpy(F, d, 3 * sizeof(double));
        memcpy(F + 3, r->q + 3 * u, 3 * sizeof(double));
        add_cross(r->c + 3 * i, d, F + 3);
        cross(c_dot, d, turn);
        bias[u] = dot(turn, omega) - dot6(F, acceleration);
    }
}

/* what the turning of a curved normal adds to the accelerations */
static void curvature(const Plan *p, const Table *t, const Index *at, int i, Rows *r)
{
    const double *omega = r->omega + 3 * i;
    double *h = r->h + 3 * i, turned[3];
    apply(r->bend + 9 * i, r->c_dot + 3 * i, h);
    r->acceleration[i] += dot(r->c_dot + 3 * i, h);
    cross(omega, h, turned);
    for (int f = at->first_F[i]; f < at->first_F[i + 1]; f++) {
        const double *d = r->directions + 3 * (p->k + f);
        r->acceleration[p->k + f] +=
            t->drill_F[f] * dot(h, omega) - t->radius[i] * dot(d, turned) - dot(d, h) * r->rate[i];
    }
}

void find_rows(const Plan *p, const double *v, const double *a, Rows *r)
{
    const Table t = table_of(p);
    const Index at = index_of(p);
    const Live *live = p->live;
    const int nu = p->nu, l = p->k + p->m + p->nf + p->kb + p->mb;
    for (int b = 0; b < p->nb; b++)
        for (int c = 0; c < nu; c++)
            if (t.support[b * nu + c] != 0.0)
                for (int e = 0; e < 6; e++) r->V[6 * b + e] += live->J[6 * c + e] * v[c];
    for (int i = 0; i < p->k; i++) {
        const int rows = 1 + at.first_F[i + 1] - at.first_F[i];
        if (at.limit_q[i] >= 0) {
            const int c = at.limit_dof[i];
            const double sign = r->W_u[c * l + i] = t.limit_sign[i];
            r->g_N[i] = gap(p, &t, &at, i, NULL, NULL, NULL);
            r->rate[i] = sign * v[c], r->acceleration[i] = sign * a[c];
            continue;
        }
        if (at.slot[i] >= 0)
            find_feature(p, &t, &at, i, r);
        else {
            surface(p, &t, &at, i, r);
            motion(p, &at, i, r, r->acceleration);
        }
        for (int c = 0; c < nu; c++) {
            const double sign = t.sign[i * nu + c];
            if (sign == 0.0) continue;
            for (int row = 0; row < rows; row++) {
                const int u = place(p, &at, i, row);
                const double w = sign * dot6(r->wrench + 6 * u, live->J + 6 * c);
                r->W_u[c * l + u] = w;
                r->rate[u] += w * v[c];
                r->acceleration[u] += w * a[c] + sign * dot6(r->wrench + 6 * u, live->dJ + 6 * c) * v[c];
            }
        }
        if (at.slot[i] < 0 && at.curved[i]) curvature(p, &t, &at, i, r);
    }
}

/* gradients of a row's rate by the position and of its acceleration by the velocity, as wrenches on J */
static void gradients(const Plan *p, const Table *t, const Index *at, int i, int u, const Rows *r, double *G_X, double *G_Y)
{
    const double *omega = r->omega + 3 * i, *turn = r->turn + 3 * u, *F = r->wrench + 6 * u, *d = r->directions + 3 * u;
    memset(G_X, 0, 6 * sizeof(double));
    if (at->moving[i]) add_force_cross(r->V + 6 * at->body_a[i], F, G_X);
    for (int e = 0; e < 6; e++) G_Y[e] = 2 * G_X[e];
    double common[3];
    cross(omega, r->q + 3 * u, common);
    for (int e = 0; e < 3; e++) {
        G_X[3 + e] += common[e] + turn[e];
        G_Y[3 + e] += common[e] + 2 * turn[e];
    }
    if (!at->curved[i]) return;
    const double *h = r->h + 3 * i;
    double e_X[3], e_Y[3];
    if (u < p->k) {
        for (int e = 0; e < 3; e++) e_X[e] = h[e], e_Y[e] = 2 * h[e];
    } else {
        const double drill = t->drill_F[u - p->k], radius = t->radius[i];
        double mixed[3], spin[3];
        cross(d, omega, mixed);
        for (int e = 0; e < 3; e++) mixed[e] = drill * omega[e] - radius * mixed[e] - r->rate[i] * d[e];
        apply(r->bend + 9 * i, mixed, e_X);
        for (int e = 0; e < 3; e++) e_Y[e] = e_X[e] - dot(d, h) * r->normals[3 * i + e];
        cross(h, d, spin);
        for (int e = 0; e < 3; e++) G_Y[3 + e] += drill * h[e] - radius * spin[e];
    }
    add_wrench(e_X, r->c + 3 * i, G_X);
    add_wrench(e_Y, r->c + 3 * i, G_Y);
}

void find_derivatives(const Plan *p, const Rows *r, double *X, double *Y)
{
    const Table t = table_of(p);
    const Index at = index_of(p);
    const Live *live = p->live;
    const int nu = p->nu, l = p->k + p->m + p->nf + p->kb + p->mb;
    memset(X, 0, (size_t)l * nu * sizeof(double));
    memset(Y, 0, (size_t)l * nu * sizeof(double));
    for (int i = 0; i < p->k; i++)
        for (int row = 0; at.limit_q[i] < 0 && row < 1 + at.first_F[i + 1] - at.first_F[i]; row++) {
            const int u = place(p, &at, i, row);
            const double *F = r->wrench + 6 * u;
            double G_X[6], G_Y[6];
            if (at.slot[i] >= 0)
                feature_gradients(&at, i, u, r, G_X, G_Y);
            else
                gradients(p, &t, &at, i, u, r, G_X, G_Y);
            for (int c = 0; c < nu; c++) {
                const double sign = t.sign[i * nu + c], *J = live->J + 6 * c;
                if (sign == 0.0) continue;
                const double by_v = dot6(F, live->dAdv + 6 * c);
                X[c * l + u] = sign * (dot6(G_X, J) + by_v - dot6(F, live->dJ + 6 * c));
                Y[c * l + u] = sign * (dot6(G_Y, J) + by_v);
            }
        }
}
