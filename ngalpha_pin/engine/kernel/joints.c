/* Twin of contact/joint_friction.py: coordinates with dry friction as rows, and their laws (137), (140). */
#include <math.h>
#include <stddef.h>

#include "kernel.h"

void find_joint_rows(const Plan *p, const double *v, const double *a, Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    for (int i = 0; i < nf; i++) {
        const int c = at.dofs[i];
        r->W_u[(size_t)c * l + j + i] = 1.0;
        r->rate[j + i] = v[c], r->acceleration[j + i] = a[c];
    }
}

static double clip(double x, double lower, double upper) { return x < lower ? lower : x > upper ? upper : x; }

/* residuals, index sets and percussions of the joints */
void find_joint_laws(const Plan *p, const Step *s, Iterate *it, Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    const Table t = table_of(p);
    const double dt = s->dt[0], gamma_c = s->gamma_c[0], *multipliers = it->x + 3 * nv;
    const int paper = s->paper[0] != 0.0, narrow = !paper && s->monotone[0] != 0.0;
    for (int i = 0; i < nf; i++) {
        const int v = n_c + i, a = n_c + nf + i;
        const double lower = dt * t.lower[i], upper = dt * t.upper[i], tau = multipliers[a], known = s->friction_known[i];
        const double course = known + gamma_c * tau, P = multipliers[v] + course, trial = P - s->r[v] * r->y[v];
        const double least = narrow ? clip(known + gamma_c * t.lower[i], lower, upper) : lower;
        const double most = narrow ? clip(known + gamma_c * t.upper[i], lower, upper) : upper;
        const int stick = trial >= least && trial <= most, below = trial < least;
        const double inside = clip(course, lower, upper);
        /* just stopped, or along the slip */
        const double trial_a = stick ? tau - s->r[a] * r->y[a] : below ? -INFINITY : INFINITY;
        const int stick_a = stick && trial_a >= t.lower[i] && trial_a <= t.upper[i];
        it->P_f[i] = P;
        r->follows[i] = inside == course && !stick && !paper ? 0.0 : gamma_c;
        r->holds[v] = stick, r->holds[a] = stick_a;
        r->R_c[v] = stick ? r->y[v] : P - (paper ? (below ? lower : upper) : inside);
        r->R_c[a] = stick_a ? r->y[a] : tau - (trial_a < t.lower[i] ? t.lower[i] : t.upper[i]);
    }
}

/* what does not stick, in one column of the derivative of the residual by the multipliers */
void joint_jacobian(const Plan *p, const Rows *r, int column, double *J)
{
    SIZES(p);
    UNUSED_SIZES;
    for (int i = 0; i < nf; i++) {
        const int v = n_c + i, a = n_c + nf + i;
        if (r->holds[v] == 0.0) J[v] = column == v ? 1.0 : column == a ? r->follows[i] : 0.0;
        if (r->holds[a] == 0.0) J[a] = column == a ? 1.0 : 0.0;
    }
}
