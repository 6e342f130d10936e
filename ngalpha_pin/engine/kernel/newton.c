/* Twin of step/newton_matrix.py: the response of the step to the multipliers, and the Newton correction. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernel.h"

/* M, D, K T and S = M + gamma_c D + beta_c K T into the work space; T is there already unless the system is flat */
void find_stiffness(const Plan *p, const Step *s, const Work *w)
{
    const int nv = p->nv, size = nv * nv, loaded = s->loaded[0] != 0.0;
    const Live *live = p->live;
    double *K = s->flat[0] != 0.0 ? w->K : w->S;
    copy_matrix(&live->M, nv, w->M);
    for (int l = 0; l < nv; l++)
        for (int i = 0; i < nv; i++) {
            K[l * nv + i] = entry(&live->K, i, l) - (loaded ? entry(&live->K_forces, i, l) : 0.0);
            w->D[l * nv + i] = entry(&live->D, i, l) - (loaded ? entry(&live->D_forces, i, l) : 0.0);
        }
    if (s->flat[0] == 0.0) {
        memset(w->K, 0, (size_t)size * sizeof(double));
        add_product(nv, nv, nv, K, w->T, nv, w->K, nv);
    }
    for (int i = 0; i < size; i++) w->S[i] = w->M[i] + s->gamma_c[0] * w->D[i] + s->beta_c[0] * w->K[i];
}

/* derivative of kappa by the multipliers, l x n */
static void find_displacements(const Plan *p, const Step *s, const Rows *r, double *E)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    const double gamma_c = s->gamma_c[0], beta_c = s->beta_c[0];
    memset(E, 0, (size_t)l * n * sizeof(double));
    for (int i = 0; i < k; i++) {
        const double ratio = r->ratio[i];
        E[(size_t)i * l + i] = 1.0;
        for (int f = at.first_F[i]; f < at.first_F[i + 1]; f++) {
            const int u = k + f;
            E[(size_t)(2 * k + f) * l + u] = ratio;
            if (s->paper[0] != 0.0 || s->displaces[0] == 0.0 || has_carried(s, i)) continue;
            E[(size_t)(3 * k + m + f) * l + u] = ratio * gamma_c - beta_c;
            /* the time since impact moves with the normal multipliers */
            E[(size_t)i * l + u] = r->share[f];
            E[(size_t)(k + i) * l + u] = -ratio * r->share[f];
            E[(size_t)(2 * k + m + i) * l + u] = (beta_c - gamma_c * ratio) * r->share[f];
        }
    }
    const int first = j + nf; /* row of the constraints */
    for (int u = 0; u < kb; u++) E[(size_t)at.at_g[k + u] * l + first + u] = 1.0;
    for (int u = j; u < l; u++)
        if (u < first || u >= first + kb) E[(size_t)at.at_v[u] * l + u] = s->dt[0] / 2; /* (80) */
}

/* Z and H of the work space: response of a, U, Q and of y to the multipliers, in the last column to the residuals.
 * Rows are found through at_g, at_v and at_a alone. */
static void respond(const Plan *p, const Step *s, const Rows *r, const Work *w, int *pivots)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    const int three = 3 * nv;
    double *Z = w->Z, *H = w->H, *da = w->wide_v;
    memset(Z, 0, (size_t)three * (n + 1) * sizeof(double));
    memset(H, 0, (size_t)n * (n + 1) * sizeof(double));
    for (int u = 0; u < l; u++)
        for (int i = 0; i < nv; i++) w->by_M[(size_t)u * nv + i] = r->W[(size_t)i * l + u];
    memcpy(w->by_M + (size_t)l * nv, r->R + nv, 2 * (size_t)nv * sizeof(double));
    cholesky_solve(nv, l + 2, w->M, w->by_M);
    for (int u = 0; u < l; u++) memcpy(Z + (size_t)at.at_v[u] * three + nv, w->by_M + (size_t)u * nv, (size_t)nv * sizeof(double));
    add_product(nv, l, n, w->by_M, w->E, l, Z + 2 * nv, three);
    for (int i = 0; i < 2 * nv; i++) Z[(size_t)n * three + nv + i] = -w->by_M[(size_t)l * nv + i];

    /* da = S^-1 (W dla - R_a - D dU - K T dQ), with the signs turned round until it is solved */
    memset(da, 0, (size_t)nv * (n + 1) * sizeof(double));
    add_product(nv, nv, n + 1, w->D, Z + nv, three, da, nv);
    add_product(nv, nv, n + 1, w->K, Z + 2 * nv, three, da, nv);
    for (int u = 0; u < l; u++)
        for (int i = 0; i < nv; i++) da[(size_t)at.at_a[u] * nv + i] -= r->W[(size_t)i * l + u];
    for (int i = 0; i < nv; i++) da[(size_t)n * nv + i] += r->R[i];
    factor_solve(nv, n + 1, w->S, da, pivots);
    for (int c = 0; c <= n; c++)
        for (int i = 0; i < nv; i++) Z[(size_t)c * three + i] = -da[(size_t)c * nv + i];
    if (n == 0) return;

    /* change of q and v, then of gaps, rates and accelerations */
    double *dv = w->wide_v, *dq = w->wide_q, *change = w->rows;
    for (int c = 0; c <= n; c++)
        for (int i = 0; i < nv; i++) {
            const double a = Z[(size_t)c * three + i];
            dv[(size_t)c * nv + i] = s->gamma_c[0] * a + Z[(size_t)c * three + nv + i];
            dq[(size_t)c * nv + i] = s->beta_c[0] * a + Z[(size_t)c * three + 2 * nv + i];
        }
    if (s->flat[0] == 0.0)
        for (int c = 0; c <= n; c++) {
            memset(w->column, 0, (size_t)nv * sizeof(double));
            add_product(nv, nv, 1, w->T, dq + (size_t)c * nv, nv, w->column, nv);
            memcpy(dq + (size_t)c * nv, w->column, (size_t)nv * sizeof(double));
        }
    const size_t rows_size = (size_t)l * (n + 1) * sizeof(double);
    memset(change, 0, rows_size);
    add_product(l, nv, n + 1, r->W, dq, nv, change, l);
    for (int c = 0; c <= n; c++)
        for (int u = 0; u < k + kb; u++) H[(size_t)c * n + at.at_g[u]] = change[(size_t)c * l + at.row_g[u]];
    memset(change, 0, rows_size);
    add_product(l, nv, n + 1, r->W, dv, nv, change, l);
    add_product(l, nv, n + 1, w->X, dq, nv, change, l);
    for (int c = 0; c <= n; c++)
        for (int u = 0; u < l; u++) H[(size_t)c * n + at.at_v[u]] = change[(size_t)c * l + u];
    memset(change, 0, rows_size);
    add_product(l, nv, n + 1, r->W, Z, three, change, l);
    add_product(l, nv, n + 1, w->Y, dv, nv, change, l);
    for (int c = 0; c <= n; c++)
        for (int u = 0; u < l; u++) H[(size_t)c * n + at.at_a[u]] = change[(size_t)c * l + u];
}

/* Z and H into the work space (see `StepEquations.linearise`) */
EXPORT void nga_linearise(const Plan *p, double *step, double *rows)
{
    const Step s = step_of(p, step);
    const Rows r = rows_of(p, rows);
    const Work w = work_of(p);
    find_stiffness(p, &s, &w);
    if (p->k + p->nf + p->kb + p->mb) {
        find_derivatives(p, &r, w.X_u, w.Y_u);
        if (p->kb + p->mb) find_frame_derivatives(p, &r, w.X_u, w.Y_u);
        if (p->nw) derivatives_into_coordinates(p, &r, &w);
        find_displacements(p, &s, &r, w.E);
    }
    respond(p, &s, &r, &w, (int *)w.pivots);
}

/* the next iterate, from the scaled multipliers of the work space */
EXPORT void nga_advance(const Plan *p, double *step, double *iterate, double *next)
{
    SIZES(p);
    UNUSED_SIZES;
    const Step s = step_of(p, step);
    const Work w = work_of(p);
    const double *x = iterate_of(p, iterate).x;
    double *dx = iterate_of(p, next).x, *dz = dx + 3 * nv;
    for (int i = 0; i < n; i++) dz[i] = w.y[i] * s.column_scale[i];
    memcpy(dx, w.Z + (size_t)n * 3 * nv, 3 * (size_t)nv * sizeof(double));
    add_product(3 * nv, n, 1, w.Z, dz, n, dx, 3 * nv);
    for (int i = 0; i < 3 * nv + n; i++) dx[i] += x[i];
    nga_move(p, step, next);
}

/* Newton correction (143) from Z and H in the work space, see `nga_correct` */
EXPORT int nga_solve(const Plan *p, double *step, double *iterate, double *rows, double *next)
{
    SIZES(p);
    UNUSED_SIZES;
    const Step s = step_of(p, step);
    const Iterate it = iterate_of(p, iterate);
    const Rows r = rows_of(p, rows);
    const Work w = work_of(p);
    if (n) {
        laws_jacobian(p, &s, &it, &r, w.H, w.column, w.J);
        for (int c = 0; c <= n; c++)
            for (int i = 0; i < n; i++) {
                const double scale = r.holds[i] != 0.0 ? s.row_scale[i] : 1.0 / s.column_scale[i];
                const double J = w.J[(size_t)c * n + i];
                if (c < n)
                    w.A[(size_t)c * n + i] = J * scale * s.column_scale[c];
                else
                    w.y[i] = w.b[i] = -(r.R_c[i] + J) * scale;
            }
        memcpy(w.LU, w.A, (size_t)n * n * sizeof(double));
        int dependent = factor_solve(n, 1, w.LU, w.y, (int *)w.pivots) != 0;
        double least = INFINITY, most = 0.0;
        for (int i = 0; i < n; i++) {
            const double pivot = fabs(w.LU[(size_t)i * n + i]);
            if (!(pivot >= least)) least = pivot;
            if (!(pivot <= most)) most = pivot;
        }
        if (dependent || !(least > s.SINGULAR[0] * most)) return 1;
    }
    nga_advance(p, step, iterate, next);
    return 0;
}

/* Newton correction (143). The result is 1 where directions are dependent: A and b are in the work space then, and the
 * caller puts y there and calls `nga_advance` */
EXPORT int nga_correct(const Plan *p, double *step, double *iterate, double *rows, double *next)
{
    nga_linearise(p, step, rows);
    return nga_solve(p, step, iterate, rows, next);
}
