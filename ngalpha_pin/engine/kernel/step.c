/* Twin of step/equations.py: R(x) of one step, and where everything is in the blocks of kernel.h. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernel.h"
#include "vectors.h"

/* changes with every function or block that binding.py relies on */
EXPORT int nga_version(void) { return 12; }

#define CARVE(name, size) parts.name = block, block += (size);
#define BLOCK(Type, FIELDS)                                                                                            \
    SIZES(p);                                                                                                          \
    Type parts;                                                                                                        \
    UNUSED_SIZES;                                                                                                      \
    FIELDS(CARVE)                                                                                                      \
    (void)block;                                                                                                       \
    return parts

static Table carve_table(const Plan *p, double *block) { BLOCK(Table, TABLE_FIELDS); }
static Index carve_index(const Plan *p, int *block) { BLOCK(Index, INDEX_FIELDS); }
static Rows carve_rows(const Plan *p, double *block) { BLOCK(Rows, ROWS_FIELDS); }
static Work carve_work(const Plan *p, double *block) { BLOCK(Work, WORK_FIELDS); }
Step step_of(const Plan *p, double *block) { BLOCK(Step, STEP_FIELDS); }
Iterate iterate_of(const Plan *p, double *block) { BLOCK(Iterate, ITERATE_FIELDS); }
Table table_of(const Plan *p) { return carve_table(p, p->table); }
Index index_of(const Plan *p) { return carve_index(p, p->index); }

/* without beams the coordinates of the joints are all there are */
Rows rows_of(const Plan *p, double *block)
{
    Rows parts = carve_rows(p, block);
    if (p->nw == 0) parts.W_u = parts.W;
    return parts;
}

Work work_of(const Plan *p)
{
    Work parts = carve_work(p, p->work);
    if (p->nw == 0) parts.X_u = parts.X, parts.Y_u = parts.Y;
    return parts;
}

#define NAME(name, size) #name " "
#define SIZE(name, size) *sizes++ = (size);
#define LIST(list, FIELDS)                                                                                             \
    EXPORT const char *nga_##list##_names(void) { return FIELDS(NAME); }                                                            \
    EXPORT void nga_##list##_sizes(const Plan *p, int *sizes)                                                                       \
    {                                                                                                                  \
        SIZES(p);                                                                                                      \
        UNUSED_SIZES;                                                                                                  \
        FIELDS(SIZE)                                                                                                   \
    }
LIST(table, TABLE_FIELDS)
LIST(index, INDEX_FIELDS)
LIST(step, STEP_FIELDS)
LIST(iterate, ITERATE_FIELDS)
LIST(rows, ROWS_FIELDS)
LIST(work, WORK_FIELDS)

/* bound of the change of any gap along dt v or dq */
static double bound(const Plan *p, double dt, const double *v)
{
    double sum = 0.0;
    for (int i = 0; i < p->nv; i++) sum += fabs(dt * v[i]) * p->live->reach[i];
    return sum;
}

/* the known part of the end of the step: (70), (71), (73), (96), (114) */
EXPORT void nga_begin_step(const Plan *p, double *step)
{
    SIZES(p);
    UNUSED_SIZES;
    const Step s = step_of(p, step);
    const double dt = s.dt[0], af = s.alpha_f[0], am = s.alpha_m[0], gamma = s.gamma[0], beta = s.beta[0];
    const double c = s.c[0] = (1 - af) / (1 - am);
    s.gamma_c[0] = dt * gamma * c, s.beta_c[0] = dt * dt * beta * c;
    s.motion[0] = bound(p, dt, s.v);
    for (int i = 0; i < nv + j + nf; i++) {
        const int smooth = i < nv, u = i - nv, o = u - j;
        const double y = smooth ? s.a[i] : u < j ? s.la[u] : s.tau_f[o];
        const double y_bar = smooth ? s.a_bar[i] : u < j ? s.la_bar[u] : s.tau_f_bar[o];
        const double known = s.known[i] = (af * y - am * y_bar) / (1 - am);
        const double once = dt * ((1 - gamma) * y_bar + gamma * known);
        const double twice = dt * dt * ((0.5 - beta) * y_bar + beta * known);
        if (smooth) {
            s.v_free[i] = s.v[i] + once;
            s.dq_free[i] = dt * s.v[i] + twice;
        } else if (u >= j)
            s.friction_known[o] = once;
        else {
            s.z_known[k + u] = once;
            if (u < k)
                s.z_known[u] = twice;
            else
                s.kappa_F_known[u - k] = twice;
        }
    }
}

/* what restitution adds to the rates (44), (48), where Pinocchio has been called with the start of the step */
EXPORT void nga_rebound(const Plan *p, double *step, double *rows)
{
    const Table t = table_of(p);
    const Step s = step_of(p, step);
    Rows r = rows_of(p, rows);
    const Shapes *of = p->live->shapes;
    find_rows(p, of ? of->u : s.v, of ? of->u_dot : s.a, &r);
    for (int u = 0; u < p->k + p->m; u++) {
        const double rate = t.e[u] * r.rate[u];
        const int opens = u < p->k && rate > 0 && s.paper[0] == 0.0;
        s.start_rates[u] = opens ? 0.0 : rate;
    }
    const Index at = index_of(p);
    for (int i = 0; s.paper[0] == 0.0 && i < p->k; i++) /* what has carried before has no impact */
        for (int f = at.first_F[i]; has_carried(&s, i) && f < at.first_F[i + 1]; f++) s.start_rates[p->k + f] = 0.0;
}

/* rows of contacts at a motion, where Pinocchio has been called with it, without the laws */
EXPORT void nga_find_rows(const Plan *p, const double *v, const double *a, double *rows)
{
    Rows r = rows_of(p, rows);
    find_rows(p, v, a, &r);
}

/* velocity and tangent step of an iterate (73), before Pinocchio is asked */
EXPORT void nga_move(const Plan *p, double *step, double *iterate)
{
    const int nv = p->nv;
    const Step s = step_of(p, step);
    const Iterate it = iterate_of(p, iterate);
    for (int i = 0; i < nv; i++) {
        it.v[i] = s.v_free[i] + s.gamma_c[0] * it.x[i] + it.x[nv + i];
        it.dq[i] = s.dq_free[i] + s.beta_c[0] * it.x[i] + it.x[2 * nv + i];
    }
    it.spent[0] = bound(p, 1.0, it.dq);
}

double entry(const Matrix *A, int i, int l) { return A->at[i * A->row + l * A->column]; }

void copy_matrix(const Matrix *A, int n, double *to)
{
    for (int l = 0; l < n; l++)
        for (int i = 0; i < n; i++) to[(size_t)l * n + i] = entry(A, i, l);
}

/* whether a contact has a force at the start of the step that is more than rounding */
int has_carried(const Step *s, int i) { return s->la[i] > (s->scaled[0] != 0.0 ? s->FORGET[0] * s->force_scale[i] : 0.0); }

/* derivative of kappa_hat_N by la_N, see `StepEquations.normal_displacement` */
double kappa_c(const Step *s, int i)
{
    return s->paper[0] == 0.0 && has_carried(s, i) ? s->dt[0] / 2 * s->gamma_c[0] : s->beta_c[0];
}

/* forces of the laws (95), (102), (113) and kappa_F (80) */
void find_forces(const Plan *p, const Step *s, Iterate *it, Rows *r, double *kappa_F)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    const double *multipliers = it->x + 3 * nv, *la = multipliers + 2 * k + m, dt = s->dt[0];
    double *z = it->z;
    for (int i = 0; i < n_c; i++) z[i] = multipliers[i] + s->z_known[i];
    for (int i = 0; i < k; i++) {
        /* of a contact that has carried before, half of the step times its part of the velocities */
        const int half = s->paper[0] == 0.0 && has_carried(s, i);
        z[i] += half ? dt / 2 * s->z_known[k + i] - s->z_known[i] : 0.0;
        z[i] += kappa_c(s, i) * la[i];
    }
    for (int i = 0; i < j; i++) z[k + i] += s->gamma_c[0] * la[i];
    for (int i = 0; i < k; i++) {
        const double P_N = z[k + i];
        const int carries = P_N > 1e-300;
        const double safe = carries ? P_N : 1.0, free = carries ? z[i] / safe : dt / 2;
        const double bounded = free > 0.0 ? (free < dt ? free : dt) : 0.0;
        /* of a contact that has carried before, friction needs no time since an impact */
        const int half = s->paper[0] != 0.0 || has_carried(s, i);
        r->ratio[i] = s->displaces[0] == 0.0 ? 0.0 : half ? dt / 2 : bounded;
        for (int f = at.first_F[i]; f < at.first_F[i + 1]; f++) {
            const double P_F = z[2 * k + f];
            if (half || s->displaces[0] == 0.0) {
                kappa_F[f] = r->ratio[i] * multipliers[2 * k + f];
                continue;
            }
            r->share[f] = carries && free == bounded ? P_F / safe : 0.0;
            kappa_F[f] = bounded * P_F - s->beta_c[0] * la[k + f] - s->kappa_F_known[f];
        }
    }
}

/* inverse mass W M^-1 W^T of each row into `G`; rows of constraints of one kind have that of the largest of them. The
 * result is that of the Cholesky factorisation */
static int find_inverse_masses(const Plan *p, const Rows *r, const Work *w, double *G)
{
    SIZES(p);
    UNUSED_SIZES;
    for (int u = 0; u < l; u++)
        for (int i = 0; i < nv; i++) w->by_M[(size_t)u * nv + i] = r->W[(size_t)i * l + u];
    if (cholesky_solve(nv, l, w->M, w->by_M)) return 1;
    for (int u = 0; u < l; u++) {
        G[u] = 0.0;
        for (int e = 0; e < nv; e++) G[u] += r->W[(size_t)e * l + u] * w->by_M[(size_t)u * nv + e];
    }
    if (b == 0) return 0;
    const int *group = p->live->frames->group;
    double *largest = G + l, least = 1e-300;
    G += j + nf; /* of the constraints */
    for (int u = 0; u < b; u++) least = bigger(least, p->live->frames->vanishes * G[u]);
    for (int i = 0; i < b; i++) {
        largest[i] = least;
        for (int e = 0; e < b; e++)
            if (group[e] == group[i]) largest[i] = bigger(largest[i], G[e]);
    }
    memcpy(G, largest, (size_t)b * sizeof(double));
    return 0;
}

/* unit of force of the step in kinetic scaling; see scaling.py */
static double find_unit(
    const Plan *p, const Step *s, const Iterate *it, const Rows *r, const double *G, const double *M, const double *h)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    const double level[3] = {1.0, s->dt[0], s->dt[0] * s->dt[0]};
    double f = bigger(s->weight[0], 1e-200);
    for (int i = 0; i < nv; i++) {
        const double root_M = sqrt(M[i]), rounding = s->ROUNDING[0] / (s->tol[0] * s->dt[0]);
        f = bigger(f, fabs(h[i]) / root_M);
        f = bigger(f, root_M * bigger(fabs(it->x[i]), rounding * fabs(it->v[i])));
    }
    const Table t = table_of(p);
    for (int i = 0; i < nf; i++) f = bigger(f, bigger(t.upper[i], -t.lower[i]) / sqrt(M[at.dofs[i]]));
    for (int i = n_c + 2 * nf; i < n; i++) /* a motion that is prescribed may be all that moves */
        f = bigger(f, fabs(r->y[i]) / (level[at.levels[i]] * sqrt(G[at.scale_rows[i]])));
    return f;
}

/* prox parameters of joint friction: a damper or a stiff servo resists more than the mass, and slip that starts is slow */
static void set_joint_parameters(const Plan *p, const Step *s, const double *G)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    const Work w = work_of(p);
    find_stiffness(p, s, &w);
    memset(w.wide_v, 0, (size_t)nv * nf * sizeof(double));
    for (int i = 0; i < nf; i++) w.wide_v[(size_t)i * nv + at.dofs[i]] = 1.0;
    factor_solve(nv, nf, w.S, w.wide_v, (int *)w.pivots);
    for (int i = 0; i < nf; i++) {
        const double soft = w.wide_v[(size_t)i * nv + at.dofs[i]], own = G[j + i];
        const double r = s->ALPHA_R[0] / (soft > 0.0 && soft < own ? soft : own);
        s->r[n_c + i] = s->r[n_c + nf + i] = r;
    }
}

/* scales of all rows and the prox parameters but those of joint friction, from the inverse mass G of each row, and of each
 * coordinate the mass, the force h without inertia, and the size of forces whose rounding is felt */
void put_scales(const Plan *p, const Step *s, const Iterate *it, const Rows *r, const double *G, const double *M, const double *h, const double *stiffness)
{
    SIZES(p);
    UNUSED_SIZES;
    const Index at = index_of(p);
    const double tol = s->tol[0], dt = s->dt[0], level[3] = {1.0, dt, dt * dt};
    double floor[3] = {0.0, 0.0, 0.0};
    const double f = find_unit(p, s, it, r, G, M, h);
    for (int i = 0; i < nv; i++) {
        const double unit = tol * f * sqrt(M[i]) + s->ROUNDING[0] * stiffness[i];
        for (int e = 0; e < 3; e++) s->by_dof[e * nv + i] = 1.0 / unit / level[e];
    }
    s->scaled[0] = 1.0;
    const Table t = table_of(p);
    for (int i = 0; i < k; i++)
        if (at.limit_q[i] >= 0) {
            floor[1] = bigger(floor[1], s->ROUNDING[0] * fabs(r->rate[i]));
            floor[2] = bigger(floor[2], s->ROUNDING[0] * fabs(t.limit_value[i]));
        }
    for (int i = 0; i < 3 * k; i++) {
        floor[1] = bigger(floor[1], s->ROUNDING[0] * fabs(r->c_dot[i]));
        floor[2] = bigger(floor[2], s->ROUNDING[0] * fabs(r->c[i]));
    }
    for (int i = j; i < j + nf; i++) floor[1] = bigger(floor[1], s->ROUNDING[0] * fabs(r->rate[i]));
    if (b)
        for (int e = 0; e < 2; e++) floor[2 - e] = bigger(floor[2 - e], s->ROUNDING[0] * r->sizes_f[e]);
    for (int i = 0; i < n; i++) {
        const int level_i = at.levels[i];
        const double root = sqrt(G[at.scale_rows[i]]);
        s->r[i] = s->ALPHA_R[0] / G[at.scale_rows[i]];
        s->row_scale[i] = 1.0 / (level[level_i] * root), s->column_scale[i] = level[level_i] / root;
        s->kinematic[i] = 1.0 / (tol * f / s->row_scale[i] + floor[level_i]);
        s->direct[i] = 1.0 / (tol * f * s->column_scale[i]);
        if (i < k) s->force_scale[i] = f / root;
    }
}

/* the same from the whole mass matrix; the result is that of the Cholesky factorisation */
static int set_scales(const Plan *p, const Step *s, const Iterate *it, const Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    const Work w = work_of(p);
    double *G = w.rows, *M = w.wide_v, *h = w.wide_q, *stiffness = w.column;
    copy_matrix(&p->live->M, nv, w.M);
    if (n && find_inverse_masses(p, r, &w, G)) return 1;
    copy_matrix(&p->live->M, nv, w.M);
    for (int i = 0; i < nv; i++) {
        M[i] = w.M[(size_t)i * nv + i], h[i] = r->residual[i], stiffness[i] = 0.0;
        for (int e = 0; e < nv; e++) h[i] -= entry(&p->live->M, i, e) * it->x[e];
        if (p->live->shapes) /* of beams, which are stiffer than all else */
            stiffness[i] = i < p->live->shapes->nt ? 0.0 : fabs(entry(&p->live->K, i, i)) * s->span[i];
        else if (s->loaded[0] != 0.0)
            for (int e = 0; e < nv; e++)
                stiffness[i] += fabs(entry(&p->live->K, i, e) - entry(&p->live->K_forces, i, e)) * s->span[e];
    }
    put_scales(p, s, it, r, G, M, h, stiffness);
    if (nf) set_joint_parameters(p, s, G);
    return 0;
}

/* largest residual in units of its tolerance; infinite where it is not a number */
double find_error(const Plan *p, const Step *s, const Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    double error = 0.0;
    for (int i = 0; i < (n ? 3 * nv : nv); i++) {
        const double x = fabs(r->R[i]) * s->by_dof[i];
        if (!(x <= error)) error = x;
        if (x != x) return INFINITY;
    }
    for (int i = 0; i < n; i++) {
        const double x = fabs(r->R_c[i]) * (r->holds[i] != 0.0 ? s->kinematic[i] : s->direct[i]);
        if (!(x <= error)) error = x;
        if (x != x) return INFINITY;
    }
    return error;
}

/* what the end of the step keeps: a_bar and la_bar (71), (96), (114), and contacts that have not let go of all force */
void find_bars(const Plan *p, const Step *s, Iterate *it, const Rows *r)
{
    SIZES(p);
    UNUSED_SIZES;
    for (int i = 0; i < nv; i++) it->a_bar[i] = s->known[i] + s->c[0] * it->x[i];
    for (int i = 0; i < j; i++) it->la_bar[i] = s->known[nv + i] + s->c[0] * it->x[3 * nv + 2 * k + m + i];
    for (int i = 0; i < nf; i++) it->bar_f[i] = s->known[nv + j + i] + s->c[0] * it->x[3 * nv + n_c + nf + i];
    for (int i = 0; i < k; i++) it->keep[i] = r->A[i] != 0.0 || fabs(it->la_bar[i]) > s->FORGET[0] * s->force_scale[i];
}

/* R(x) (127)-(142) where Pinocchio has just been called; the result is its error */
EXPORT double nga_evaluate(const Plan *p, double *step, double *iterate, double *rows)
{
    SIZES(p);
    UNUSED_SIZES;
    const Step s = step_of(p, step);
    Iterate it = iterate_of(p, iterate);
    Rows r = rows_of(p, rows);
    const Work w = work_of(p);
    const Index at = index_of(p);
    const double *multipliers = it.x + 3 * nv;
    for (int i = 0; i < nv; i++) r.residual[i] = p->live->residual[i] - (s.loaded[0] != 0.0 ? p->live->tau[i] : 0.0);
    memcpy(r.R, r.residual, (size_t)nv * sizeof(double));
    if (n) {
        double *forces = w.rows, *kappa = forces + 2 * l; /* la, La, kappa: (74), (78), (80) */
        const Shapes *of = p->live->shapes;
        const double *u = of ? of->u : it.v, *u_dot = of ? of->u_dot : it.x;
        find_rows(p, u, u_dot, &r);
        find_joint_rows(p, u, u_dot, &r);
        if (b) find_frame_rows(p, u, u_dot, &r);
        if (nw) into_coordinates(p, r.W_u, r.W);
        for (int u = 0; u < l; u++) {
            forces[u] = multipliers[at.at_a[u]], forces[l + u] = multipliers[at.at_v[u]];
            kappa[u] = s.dt[0] / 2 * multipliers[at.at_v[u]]; /* of joints, and of constraints on velocity level */
        }
        for (int u = 0; u < k + kb; u++) kappa[at.row_g[u]] = multipliers[at.at_g[u]];
        find_forces(p, &s, &it, &r, kappa + k);
        for (int i = 0; i < nv; i++) {
            const double *w_i = r.W + (size_t)i * l;
            double sums[3] = {0.0, 0.0, 0.0};
            for (int e = 0; e < 3; e++)
                for (int u = 0; u < l; u++) sums[e] += w_i[u] * forces[e * l + u];
            for (int o = 1; o < 3; o++)
                for (int e = 0; e < nv; e++) r.R[o * nv + i] += entry(&p->live->M, i, e) * it.x[o * nv + e];
            for (int e = 0; e < 3; e++) r.R[e * nv + i] -= sums[e];
        }
        for (int u = 0; u < k + kb; u++) r.y[at.at_g[u]] = u < k ? r.g_N[u] : r.g[u - k];
        for (int u = 0; u < l; u++) {
            r.y[at.at_v[u]] = u < j ? r.rate[u] + s.start_rates[u] : r.rate[u]; /* (44), (48) */
            r.y[at.at_a[u]] = r.acceleration[u];
        }
    }
    if (s.scaled[0] == 0.0 && set_scales(p, &s, &it, &r)) return INFINITY;
    if (n) find_laws(p, &s, &it, &r);
    find_bars(p, &s, &it, &r);
    return find_error(p, &s, &r);
}
