/* Twin of constraints/frame_rows.py and constraints/driven_angle.py: rows that tie two frames to each other, their rates,
 * and their derivatives. */
#include <math.h>
#include <string.h>

#include "kernel.h"
#include "vectors.h"

enum { PLANE, DISTANCE, AXES, BLADE, ANGLE };

/* world velocity of each joint that is in use, at V: 6 x nj */
static void find_twists(const Plan *p, const Frames *f, const double *v, double *V)
{
    memset(V, 0, 6 * (size_t)f->nj * sizeof(double));
    for (int o = 0; o < f->nj; o++)
        for (int c = 0; c < p->nu; c++)
            if (f->support[o * p->nu + c] != 0.0)
                for (int e = 0; e < 6; e++) V[6 * o + e] += p->live->J[6 * c + e] * v[c];
}

static void measure(const double *x, int size, double *largest)
{
    for (int e = 0; e < size; e++) *largest = bigger(*largest, fabs(x[e]));
}

/* direction d and couple q of row i, its wrench, and the gap where it has one */
static void place(const Plan *p, const Frames *f, int i, Rows *r)
{
    const int kind = f->kind[i];
    const double *R_a = f->poses[2 * f->a[i]], *p_a = f->poses[2 * f->a[i] + 1];
    const double *R_b = f->poses[2 * f->b[i]], *p_b = f->poses[2 * f->b[i] + 1];
    double *n = r->n_f + 3 * i, *b = r->b_f + 3 * i, *c = r->c_f + 3 * i, *d = r->d_f + 3 * i, *F = r->wrench_f + 6 * i;
    double on_a[3], on_b[3], arm[3];
    apply(R_a, f->vector_a + 3 * i, n);
    apply(R_b, f->vector_b + 3 * i, b);
    apply(R_a, f->point_a + 3 * i, on_a);
    apply(R_b, f->point_b + 3 * i, on_b);
    for (int e = 0; e < 3; e++) c[e] = on_b[e] + p_b[e], arm[e] = c[e] - on_a[e] - p_a[e];
    /* a point near the origin is the difference of large numbers */
    measure(on_a, 3, r->sizes_f), measure(on_b, 3, r->sizes_f), measure(p_a, 3, r->sizes_f), measure(p_b, 3, r->sizes_f);
    const double rho = bigger(sqrt(dot(arm, arm)), 1e-300);
    r->by_rho[i] = kind == DISTANCE ? 1.0 / rho : 0.0;
    for (int e = 0; e < 3; e++) d[e] = kind == AXES ? 0.0 : kind == BLADE ? b[e] : kind == DISTANCE ? arm[e] / rho : n[e];
    memcpy(F, d, 3 * sizeof(double));
    cross(c, d, F + 3);
    if (kind == AXES) add_cross(b, n, F + 3);
    if (i < p->kb) r->g[i] = kind == PLANE ? dot(n, arm) : kind == DISTANCE ? rho - f->length[i] : dot(n, b);
}

/* the same of an angle about the axis n of A, between its axis `point_a` and `vector_b` of B; see `DrivenAngleRows` */
static void place_angle(const Frames *f, int i, Rows *r)
{
    const double pi = acos(-1.0), *R_a = f->poses[2 * f->a[i]], *R_b = f->poses[2 * f->b[i]];
    double *n = r->n_f + 3 * i, *b = r->b_f + 3 * i, *F = r->wrench_f + 6 * i, x[3], y[3];
    apply(R_a, f->vector_a + 3 * i, n);
    apply(R_b, f->vector_b + 3 * i, b);
    apply(R_a, f->point_a + 3 * i, x);
    cross(n, x, y);
    memset(r->c_f + 3 * i, 0, 3 * sizeof(double)), memset(r->d_f + 3 * i, 0, 3 * sizeof(double));
    memset(F, 0, 3 * sizeof(double)), memcpy(F + 3, n, 3 * sizeof(double));
    r->by_rho[i] = 0.0;
    const double away = fmod(atan2(dot(y, b), dot(x, b)) - f->wanted[3 * f->follows[i]] + pi, 2 * pi);
    r->g[i] = away + (away < 0.0 ? 2 * pi : 0.0) - pi;
    r->sizes_f[0] = bigger(r->sizes_f[0], pi);
}

/* rate of row i, and what its acceleration has besides that of the coordinates */
static void move(const Frames *f, int i, const double *V, Rows *r, double *rate, double *bias)
{
    const int kind = f->kind[i];
    const double *F = r->wrench_f + 6 * i, *d = r->d_f + 3 * i;
    double *V_a = r->V_a + 6 * i, *V_b = r->V_b + 6 * i, *c_dot = r->c_dot_f + 3 * i, *e_dot = r->e_dot + 3 * i;
    double relative[6], turned[6] = {0}, turn[3], mixed[3], *b_dot = r->b_dot + 3 * i;
    memcpy(V_a, V + 6 * f->a[i], 6 * sizeof(double));
    memcpy(V_b, V + 6 * f->b[i], 6 * sizeof(double));
    for (int e = 0; e < 6; e++) relative[e] = V_b[e] - V_a[e];
    const double *omega = relative + 3;
    *rate = dot6(F, relative);
    memcpy(c_dot, relative, 3 * sizeof(double));
    add_cross(omega, r->c_f + 3 * i, c_dot);
    const double along = dot(d, c_dot);
    for (int e = 0; e < 3; e++) e_dot[e] = r->by_rho[i] * (c_dot[e] - along * d[e]);
    cross(omega, r->b_f + 3 * i, b_dot);
    cross(c_dot, d, turn);
    *bias = dot(e_dot, c_dot) + dot(turn, omega);
    if (kind == AXES) {
        cross(b_dot, r->n_f + 3 * i, mixed);
        *bias += dot(mixed, omega);
    }
    if (kind == BLADE) *bias += dot(b_dot, c_dot);
    cross(V_a + 3, relative, turned);
    add_cross(V_a, omega, turned);
    cross(V_a + 3, omega, turned + 3);
    *bias -= dot6(F, turned);
    if (kind != ANGLE) measure(V_a, 6, r->sizes_f + 1);
    measure(V_b, 6, r->sizes_f + 1);
}

/* take what row i, of all whose first is `first`, follows over time off its rate and acceleration */
void follow(const Frames *f, int i, int first, Rows *r)
{
    if (f->follows[i] < 0) return;
    const double *wanted = f->wanted + 3 * f->follows[i];
    r->rate[first + i] -= wanted[1], r->acceleration[first + i] -= wanted[2];
    r->sizes_f[1] = bigger(r->sizes_f[1], fabs(wanted[1]));
}

void find_frame_rows(const Plan *p, const double *v, const double *a, Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    const Live *live = p->live;
    const Frames *f = live->frames;
    double *V = r->V_joints;
    find_twists(p, f, v, V);
    r->sizes_f[0] = f->unit;
    for (int i = 0; i < f->n; i++) {
        const double *F = r->wrench_f + 6 * i, *of_a = f->support + f->a[i] * nu, *of_b = f->support + f->b[i] * nu;
        double bias, sum = 0.0;
        if (f->kind[i] == ANGLE)
            place_angle(f, i, r);
        else
            place(p, f, i, r);
        move(f, i, V, r, r->rate + j + nf + i, &bias);
        for (int c = 0; c < nu; c++) {
            const double sign = of_b[c] - of_a[c];
            if (sign == 0.0) continue;
            const double w = r->W_u[(size_t)c * l + j + nf + i] = sign * dot6(F, live->J + 6 * c);
            sum += w * a[c] + sign * dot6(F, live->dJ + 6 * c) * v[c];
        }
        r->acceleration[j + nf + i] = sum + bias;
        follow(f, i, j + nf, r);
    }
    find_coupling_rows(p, v, a, r);
}

/* gradients of a row's rate by the position and of its acceleration by the velocity, as wrenches on J */
static void gradients(const Frames *f, const Rows *r, int i, double *G_X, double *G_Y)
{
    const int axes = f->kind[i] == AXES, blade = f->kind[i] == BLADE;
    const double *F = r->wrench_f + 6 * i, *d = r->d_f + 3 * i, *c = r->c_f + 3 * i, *n = r->n_f + 3 * i;
    const double *c_dot = r->c_dot_f + 3 * i, *e_dot = r->e_dot + 3 * i;
    double omega[3], e_X[3], e_Y[3], turned[3];
    for (int e = 0; e < 3; e++) omega[e] = r->V_b[6 * i + 3 + e] - r->V_a[6 * i + 3 + e];
    memset(G_X, 0, 6 * sizeof(double));
    add_force_cross(r->V_b + 6 * i, F, G_X);
    memcpy(G_Y, G_X, 6 * sizeof(double));
    add_force_cross(r->V_a + 6 * i, F, G_Y);
    cross(d, omega, e_X);
    for (int e = 0; e < 3; e++) e_Y[e] = (blade ? 0.0 : e_X[e]) + 2 * e_dot[e], e_X[e] += e_dot[e];
    add_wrench(e_X, c, G_X);
    add_wrench(e_Y, c, G_Y);
    if (axes) {
        cross(n, omega, turned);
        add_cross(r->b_f + 3 * i, turned, G_X + 3);
        add_cross(r->b_f + 3 * i, turned, G_Y + 3);
        add_cross(r->b_dot + 3 * i, n, G_Y + 3);
    }
    if (blade)
        add_cross(d, c_dot, G_X + 3);
    else
        add_cross(c_dot, d, G_Y + 3);
}

void find_frame_derivatives(const Plan *p, const Rows *r, double *X, double *Y)
{
    SIZES(p);
    UNUSED_SIZES;
    const Live *live = p->live;
    const Frames *f = live->frames;
    for (int i = 0; i < f->n; i++) {
        const double *F = r->wrench_f + 6 * i, *of_a = f->support + f->a[i] * nu, *of_b = f->support + f->b[i] * nu;
        double G_X[6], G_Y[6];
        gradients(f, r, i, G_X, G_Y);
        for (int c = 0; c < nu; c++) {
            const double sign = of_b[c] - of_a[c], *J = live->J + 6 * c;
            if (sign == 0.0) continue;
            const double by_v = dot6(F, live->dAdv + 6 * c);
            X[(size_t)c * l + j + nf + i] = sign * (dot6(G_X, J) + by_v - dot6(F, live->dJ + 6 * c));
            Y[(size_t)c * l + j + nf + i] = sign * (dot6(G_Y, J) + by_v);
        }
    }
    find_coupling_derivatives(p, r, X, Y);
}
