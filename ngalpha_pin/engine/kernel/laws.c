/* Twin of contact/laws.py: the residual of the laws on their index sets, and its derivative by the multipliers. */
#include <math.h>
#include <string.h>

#include "kernel.h"

static double norm(const double *x, int size)
{
    double sum = 0.0;
    for (int i = 0; i < size; i++) sum += x[i] * x[i];
    return sqrt(sum);
}

/* x over its norm, and the norm in every entry */
static void make_unit(const double *x, int size, double *unit, double *norms)
{
    double length = norm(x, size);
    if (length < 1e-300) length = 1e-300;
    for (int i = 0; i < size; i++) unit[i] = x[i] / length, norms[i] = length;
}

/* the friction rows of one contact and where its forces are */
typedef struct {
    int first, size;  /* friction rows */
    int P_N, P_F, la_N, la_F;
} Place;

static Place place_of(const Plan *p, const Index *at, int i)
{
    const int k = p->k, m = p->m, first = at->first_F[i];
    return (Place){first, at->first_F[i + 1] - first, k + i, 2 * k + first, 2 * k + m + i, 3 * k + m + first};
}

/* slipping rows of (138) and (142) of contact i */
static void slip(const Plan *p, double mu, int i, Place o, const Step *s, const Iterate *it, Rows *r)
{
    const double whole = s->paper[0], *z = it->z, *La = it->x + 3 * p->nv + p->k;
    const int f = o.first;
    r->slips[0] = 1.0;
    if (r->stick[i] == 0.0) {
        double *unit_v = r->unit_v + f, c[3];
        for (int e = 0; e < o.size; e++) {
            const double y = r->y[o.P_F + e];
            c[e] = s->slackened[0] != 0.0 ? s->r[o.P_F + e] * y - z[o.P_F + e] : y;
        }
        make_unit(c, o.size, unit_v, r->norm_v + f);
        const double size = mu * (La[i] + whole * (z[o.P_N] - La[i])), cap = mu * (z[o.P_N] > 0.0 ? z[o.P_N] : 0.0);
        for (int e = 0; e < o.size; e++) c[e] = (1 - whole) * (z[o.P_F + e] - La[p->k + f + e]) - size * unit_v[e];
        make_unit(c, o.size, r->unit_c + f, r->norm_c + f);
        const int capped = r->norm_c[f] > cap * (1 + 1e-12) + 1e-290;
        for (int e = 0; e < o.size; e++) {
            r->size_v[f + e] = size, r->cap[f + e] = cap, r->capped[f + e] = capped;
            r->R_c[o.P_F + e] = z[o.P_F + e] - (capped ? cap * r->unit_c[f + e] : c[e]);
        }
    }
    /* at the end of the step along the slip velocity (120), or, just stopped, along the slip acceleration */
    const double *along = r->stick[i] == 0.0 ? r->rate + p->k + f : r->y + o.la_F;
    make_unit(along, o.size, r->unit_a + f, r->norm_a + f);
    for (int e = 0; e < o.size; e++) r->R_c[o.la_F + e] = z[o.la_F + e] + mu * z[o.la_N] * r->unit_a[f + e];
}

void find_laws(const Plan *p, const Step *s, Iterate *it, Rows *r)
{
    const Table t = table_of(p);
    const Index at = index_of(p);
    const double *y = r->y, *z = it->z;
    for (int i = 0; i < p->k; i++) {
        const Place o = place_of(p, &at, i);
        double trial[3], trial_a[3];
        for (int e = 0; e < o.size; e++) {
            trial[e] = s->r[o.P_F + e] * y[o.P_F + e] - z[o.P_F + e];
            trial_a[e] = s->r[o.la_F + e] * y[o.la_F + e] - z[o.la_F + e];
        }
        const double trial_N = s->r[i] * y[i] - z[i];
        int A = trial_N <= s->slack[i];
        int B = A && s->r[o.P_N] * y[o.P_N] - z[o.P_N] <= 0.0;
        int C = B && s->r[o.la_N] * y[o.la_N] - z[o.la_N] <= 0.0 && s->accelerates[0] != 0.0;
        int stick = A && norm(trial, o.size) <= s->EDGE[0] * t.mu[i] * z[o.P_N];
        const int holds_a = norm(trial_a, o.size) <= s->EDGE[0] * t.mu[i] * z[o.la_N];
        int stick_a = stick && holds_a && s->accelerates[0] != 0.0;
        if (s->prescribed[0] != 0.0) {
            const double *in = s->sets + i;
            A = in[0] != 0.0, B = in[p->k] != 0.0, C = in[2 * p->k] != 0.0;
            stick = in[3 * p->k] != 0.0, stick_a = in[4 * p->k] != 0.0;
        }
        r->A[i] = A, r->holds[i] = s->slackened[0] != 0.0 ? trial_N <= 0.0 : A;
        r->B[i] = r->holds[o.P_N] = B;
        r->C[i] = r->holds[o.la_N] = C;
        r->stick[i] = stick, r->stick_a[i] = stick_a;
        for (int e = 0; e < o.size; e++) r->holds[o.P_F + e] = stick, r->holds[o.la_F + e] = stick_a;
    }
    SIZES(p);
    UNUSED_SIZES;
    for (int i = 0; i < n_c; i++) r->R_c[i] = r->holds[i] != 0.0 ? y[i] : z[i];
    for (int i = n_c + 2 * nf; i < n; i++) r->holds[i] = 1.0, r->R_c[i] = y[i]; /* of constraints: (84), (85) */
    find_joint_laws(p, s, it, r);
    for (int i = 0; i < p->k; i++) {
        const Place o = place_of(p, &at, i);
        if (o.size && r->A[i] != 0.0 && r->stick_a[i] == 0.0) slip(p, t.mu[i], i, o, s, it, r);
    }
}

/* x becomes the derivative of its direction: (x - unit (unit.x)) / norm */
static void turn(const double *unit, double norm, int size, double *x)
{
    double along = 0.0;
    for (int i = 0; i < size; i++) along += unit[i] * x[i];
    for (int i = 0; i < size; i++) x[i] = (x[i] - along * unit[i]) / norm;
}

/* slipping rows of one column; column number c >= n is a change of y that is given */
static void slip_column(
    double mu, int i, Place o, const Step *s, const Iterate *it, const Rows *r, int c, const double *h,
    const double *dz, double *J)
{
    const double whole = s->paper[0], gamma_c = s->gamma_c[0];
    const int f = o.first, slips = r->stick[i] == 0.0;
    double x[3];
    if (slips) {
        const double *unit_v = r->unit_v + f;
        memcpy(x, h + o.P_F, (size_t)o.size * sizeof(double));
        turn(unit_v, r->norm_v[f], o.size, x);
        for (int e = 0; e < o.size; e++) {
            x[e] *= -r->size_v[f + e];
            if (c == o.P_N) x[e] -= mu * unit_v[e];
            if (c == o.la_N) x[e] -= whole * gamma_c * mu * unit_v[e];
            if (c == o.la_F + e) x[e] += (1 - whole) * gamma_c;
        }
        if (r->capped[f] != 0.0) {
            turn(r->unit_c + f, r->norm_c[f], o.size, x);
            for (int e = 0; e < o.size; e++) x[e] = r->cap[f + e] * x[e] + mu * r->unit_c[f + e] * dz[o.P_N];
        }
        for (int e = 0; e < o.size; e++) J[o.P_F + e] = dz[o.P_F + e] - x[e];
    }
    memcpy(x, h + (slips ? o.P_F : o.la_F), (size_t)o.size * sizeof(double));
    turn(r->unit_a + f, r->norm_a[f], o.size, x);
    for (int e = 0; e < o.size; e++) {
        J[o.la_F + e] = mu * it->z[o.la_N] * x[e];
        if (c == o.la_F + e) J[o.la_F + e] += 1.0;
        if (c == o.la_N) J[o.la_F + e] += mu * r->unit_a[f + e];
    }
}

/* H and J have n + 1 columns; dz is room for n numbers */
void laws_jacobian(const Plan *p, const Step *s, const Iterate *it, const Rows *r, const double *H, double *dz, double *J)
{
    SIZES(p);
    UNUSED_SIZES;
    const Table t = table_of(p);
    const Index at = index_of(p);
    memset(dz, 0, (size_t)n * sizeof(double));
    for (int c = 0; c <= n; c++) {
        const double *h = H + (size_t)c * n;
        double *out = J + (size_t)c * n;
        const int la = c < n_c ? c - k - j : -1; /* row of W that this multiplier of a contact is the force of */
        if (c < n) dz[c] = 1.0;
        if (c < n && la >= 0) dz[k + la] = s->gamma_c[0];
        if (c < n && la >= 0 && la < k) dz[la] = kappa_c(s, la);
        for (int i = 0; i < n; i++) out[i] = i >= n_c || r->holds[i] != 0.0 ? h[i] : dz[i];
        for (int i = 0; r->slips[0] != 0.0 && i < k; i++) {
            const Place o = place_of(p, &at, i);
            if (o.size && r->A[i] != 0.0 && r->stick_a[i] == 0.0) slip_column(t.mu[i], i, o, s, it, r, c, h, dz, out);
        }
        joint_jacobian(p, r, c, out);
        if (c < n) dz[c] = 0.0;
        if (c < n && la >= 0) dz[k + la] = 0.0;
        if (c < n && la >= 0 && la < k) dz[la] = 0.0;
    }
}
