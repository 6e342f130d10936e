/* Twin of `sweeps` in numerics/gauss_seidel.py: Gauss-Seidel prox sweeps over the contacts of a one-level contact problem. */
#include <math.h>

#include "kernel.h"

/* G by columns: the entries of column c are value[start[c] ...], in the rows row[...] */
typedef struct {
    const int *start, *row;
    const double *value;
} Columns;

/* let P of one row change by `step`; the result is the size of the change */
static double change_by(const Columns *G, int c, double step, double root, double *P, double *y)
{
    if (step == 0.0) return 0.0;
    for (int e = G->start[c]; e < G->start[c + 1]; e++) y[G->row[e]] += G->value[e] * step;
    P[c] += step;
    return fabs(step) * root;
}

/* sizes: contacts, first row behind the friction of contacts, all rows, last sweep; first_F: friction rows of contact j
 * are first_F[j] ... first_F[j + 1]; state: number of sweeps so far, size of the change of the first one, of the last one;
 * limits: tolerance, growth at which sweeps diverge. The result is 1 for converged, -1 for diverged, 0 otherwise. */
EXPORT int nga_sweep(
    const int *sizes, const int *first_F, const int *start, const int *row, const double *value, const double *diagonal,
    const double *mu, const double *lower, const double *upper, const double *limits, double *state, double *P, double *y)
{
    const int k = sizes[0], with_cone = sizes[1], n = sizes[2];
    const Columns G = {start, row, value};
    while (state[0] < sizes[3]) {
        double most = 0.0, largest = 0.0;
        for (int j = 0; j < k; j++) {
            const double wanted = P[j] - y[j] / diagonal[j]; /* (131) */
            most = fmax(most, change_by(&G, j, fmax(0.0, wanted) - P[j], sqrt(diagonal[j]), P, y));
            double r = 0.0, norm = 0.0, to[3];
            for (int f = first_F[j]; f < first_F[j + 1]; f++) r = fmax(r, diagonal[f]);
            for (int f = first_F[j]; f < first_F[j + 1]; f++) {
                to[f - first_F[j]] = P[f] - y[f] / r; /* (137) */
                norm += to[f - first_F[j]] * to[f - first_F[j]];
            }
            norm = sqrt(norm);
            const double radius = mu[j] * P[j], part = norm > radius ? radius / norm : 1.0;
            for (int f = first_F[j]; f < first_F[j + 1]; f++)
                most = fmax(most, change_by(&G, f, part * to[f - first_F[j]] - P[f], sqrt(diagonal[f]), P, y));
        }
        for (int i = with_cone; i < n; i++) {
            const double wanted = P[i] - y[i] / diagonal[i];
            const double bounded = fmin(fmax(wanted, lower[i - with_cone]), upper[i - with_cone]);
            most = fmax(most, change_by(&G, i, bounded - P[i], sqrt(diagonal[i]), P, y));
        }
        state[2] = most;
        if (++state[0] == 1)
            state[1] = most;
        else if (most > limits[1] * state[1] || !(most == most))
            return -1;
        for (int i = 0; i < n; i++) largest = fmax(largest, fabs(P[i]) * sqrt(diagonal[i]));
        if (most <= limits[0] * fmax(largest, 1e-300)) return 1;
    }
    return 0;
}
