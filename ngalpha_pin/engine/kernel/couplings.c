/* Twin of constraints/joint_coupling.py and constraints/joint_trajectory.py: joints that are geared to each other,
 * g = q1 - polynomial(q2), and those that follow a function of time, which have no polynomial. */
#include <math.h>
#include <stddef.h>

#include "kernel.h"
#include "vectors.h"

/* sum of factor times coordinate; a continuous joint counts by its angle. `size` grows to its largest part */
static double sum_at(const Frames *f, const double *q, int sum, double *size)
{
    double value = 0.0;
    for (int i = f->first_part[sum]; i < f->first_part[sum + 1]; i++) {
        const int at = f->part[i], turns = at < 0;
        const double x = turns ? atan2(q[-at], q[-at - 1]) : q[at];
        value += f->factor[i] * x;
        *size = bigger(*size, fabs(f->factor[i] * (turns ? 2 * acos(-1.0) : x)));
    }
    return value;
}

/* the polynomial of coupling u and its first two derivatives */
static void polynomial(const Frames *f, int u, double x, double *p)
{
    p[0] = p[1] = p[2] = 0.0;
    for (int i = f->first_power[u + 1] - 1; i >= f->first_power[u]; i--) {
        p[2] = 2 * p[1] + p[2] * x;
        p[1] = p[0] + p[1] * x;
        p[0] = f->power[i] + p[0] * x;
    }
}

/* how far the joint of row i is ahead of what it follows; an angle (cosine, sine) by the shorter way */
static double ahead(const Plan *p, const Frames *f, int u, double wanted)
{
    const int at = f->part[f->first_part[u]];
    const double *q = p->live->q;
    if (at >= 0) return q[at] - wanted;
    const double x = q[-at - 1], y = q[-at];
    return atan2(y * cos(wanted) - x * sin(wanted), x * cos(wanted) + y * sin(wanted));
}

static double along(const double *row, const double *x, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++)
        if (row[i] != 0.0) sum += row[i] * x[i];
    return sum;
}

void find_coupling_rows(const Plan *p, const double *v, const double *a, Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    const Frames *f = p->live->frames;
    for (int u = 0; u < f->nc; u++) {
        const double *A = f->rows + (size_t)u * nu, *B = f->rows + (size_t)(f->nc + u) * nu;
        const int row = j + nf + f->n + u;
        double poly[3];
        if (f->follows[f->n + u] >= 0) {
            const double wanted = f->wanted[3 * f->follows[f->n + u]];
            r->g[f->n + u] = ahead(p, f, u, wanted);
            r->sizes_f[0] = bigger(r->sizes_f[0], fabs(wanted));
            for (int c = 0; c < nu; c++) r->W_u[(size_t)c * l + row] = A[c];
            r->rate[row] = along(A, v, nu), r->acceleration[row] = along(A, a, nu);
            r->d_f[3 * (f->n + u)] = 0.0;
            follow(f, f->n + u, j + nf, r);
            continue;
        }
        r->sizes_f[0] = bigger(r->sizes_f[0], 1.0);
        const double follower = sum_at(f, p->live->q, u, r->sizes_f);
        polynomial(f, u, sum_at(f, p->live->q, f->nc + u, r->sizes_f), poly);
        const double gap = follower - poly[0], turn = f->turn[u], v_B = along(B, v, nu);
        r->g[f->n + u] = isinf(turn) ? gap : gap - turn * nearbyint(gap / turn);
        r->acceleration[row] = along(A, a, nu) - poly[1] * along(B, a, nu) - poly[2] * v_B * v_B;
        double rate = 0.0;
        for (int c = 0; c < nu; c++) {
            if (A[c] == 0.0 && B[c] == 0.0) continue;
            const double w = r->W_u[(size_t)c * l + row] = A[c] - poly[1] * B[c];
            rate += w * v[c];
            r->sizes_f[1] = bigger(r->sizes_f[1], fabs(v[c]));
        }
        r->rate[row] = rate;
        r->d_f[3 * (f->n + u)] = -poly[2] * v_B; /* what the rate changes by, along B */
    }
}

void find_coupling_derivatives(const Plan *p, const Rows *r, double *X, double *Y)
{
    SIZES(p);
    UNUSED_SIZES;
    const Frames *f = p->live->frames;
    for (int u = 0; u < f->nc; u++)
        for (int c = 0; c < nu; c++) {
            const size_t at = (size_t)c * l + j + nf + f->n + u;
            X[at] = r->d_f[3 * (f->n + u)] * f->rows[(size_t)(f->nc + u) * nu + c];
            Y[at] = 2 * X[at];
        }
}
