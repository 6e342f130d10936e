/* Twin of contact/feature_rows.py: gaps, normals and wrenches of two features that may move, roll and turn. */
#include <math.h>
#include <string.h>

#include "kernel.h"
#include "vectors.h"

/* of a packed row, see collision/features.py */
enum { SIDE = 19, NORMAL = 2 * SIDE, VANISHED = NORMAL + 3, WIDTH = VANISHED + 1 };

/* as in feature_rows.py */
static const double CONVERGED = 1e-8, SHARP = 1e-5, ROUND = 1e-9, TURN = 0.5, TINY = 1e-300, SMALLEST = 1e-150;
enum { MAX_NEWTON = 25 };

/* one side in the world; E by its two columns, matrices by columns */
typedef struct {
    double c[3], E[6], Q[9], r, sign, face_normal[3];
    int is_face;
} Side;

/* a contact: its sides, the normal from A to B, the points of both, the gap along it, and the ways (alpha, beta) */
typedef struct {
    Side a, b;
    double n[3], p_A[3], p_B[3], g, beta[2], vanished;
    int live;
} Contact;

static Side side_of(const double *packed, const double *R, const double *p, double sign)
{
    Side s = {.r = packed[18], .sign = sign};
    double columns[9], turned[9];
    apply(R, packed, s.c);
    for (int e = 0; e < 3; e++) s.c[e] += p[e];
    for (int f = 0; f < 2; f++) {
        const double E[3] = {packed[3 + f], packed[5 + f], packed[7 + f]};
        apply(R, E, s.E + 3 * f);
    }
    s.is_face = (packed[3] != 0.0 || packed[5] != 0.0 || packed[7] != 0.0) &&
                (packed[4] != 0.0 || packed[6] != 0.0 || packed[8] != 0.0);
    cross(s.E, s.E + 3, s.face_normal);
    for (int f = 0; f < 3; f++) apply(R, packed + 9 + 3 * f, columns + 3 * f); /* R Q, Q is symmetric */
    for (int e = 0; e < 3; e++) { /* rows of R Q, turned again */
        const double row[3] = {columns[e], columns[3 + e], columns[6 + e]};
        apply(R, row, turned + 3 * e);
    }
    memcpy(s.Q, turned, sizeof s.Q);
    return s;
}

/* Q n, and sqrt(n.Q n) */
static double stretched(const Side *s, const double *n, double *Qn)
{
    apply(s->Q, n, Qn);
    const double square = dot(n, Qn);
    return square > 0.0 ? sqrt(square) : 0.0;
}

/* the point of a side with the normal n of A; the outward one of B is -n */
static void point(const Side *s, const double *n, double *x)
{
    double Qn[3];
    const double size = bigger(stretched(s, n, Qn), TINY);
    for (int e = 0; e < 3; e++) x[e] = s->c[e] + s->sign * (s->r * n[e] + Qn[e] / size);
}

/* add the derivative of the point by the outward normal */
static void add_radii(const Side *s, const double *n, double *R)
{
    double Qn[3];
    const double size = bigger(stretched(s, n, Qn), SMALLEST);
    for (int e = 0; e < 3; e++) Qn[e] /= size;
    for (int e = 0; e < 3; e++)
        for (int f = 0; f < 3; f++)
            R[3 * f + e] += (s->Q[3 * f + e] - Qn[e] * Qn[f]) / size + s->r * ((e == f) - n[e] * n[f]);
}

/* two tangents of a normal */
static void tangents(const double *n, double *T)
{
    double axis[3] = {0.0, 0.0, 0.0};
    int least = 0;
    for (int e = 1; e < 3; e++)
        if (fabs(n[e]) < fabs(n[least])) least = e;
    axis[least] = 1.0;
    cross(n, axis, T);
    const double size = sqrt(dot(T, T));
    for (int e = 0; e < 3; e++) T[e] /= size;
    cross(n, T, T + 3);
}

/* Newton matrix of (dn, alpha, beta) in the tangents T, 6 x 6 by columns; symmetric */
static void newton_matrix(const Contact *x, const double *T, double *A)
{
    double radii[9] = {0}, by_T[3], apart[3], square = 0.0;
    memset(A, 0, 36 * sizeof(double));
    add_radii(&x->a, x->n, radii), add_radii(&x->b, x->n, radii);
    for (int f = 0; f < 2; f++) {
        apply(radii, T + 3 * f, by_T);
        for (int e = 0; e < 2; e++) A[6 * f + e] = dot(T + 3 * e, by_T);
    }
    /* where two corners touch there is no curvature left; a small one keeps the matrix regular */
    for (int e = 0; e < 3; e++) apart[e] = x->b.c[e] - x->a.c[e];
    for (int e = 0; e < 9; e++) square += radii[e] * radii[e];
    const double floor = sqrt(SHARP * SHARP * dot(apart, apart) + ROUND * ROUND * square + TINY);
    const double g = fabs(x->g) > floor ? x->g : floor;
    A[0] += g, A[7] += g;
    const Side *sides[2] = {&x->a, &x->b};
    for (int i = 0; i < 2; i++)
        for (int f = 0; f < 2; f++) {
            const double *E = sides[i]->E + 3 * f;
            const int place = 2 + 2 * i + f;
            for (int e = 0; e < 2; e++) A[6 * place + e] = A[6 * e + place] = dot(T + 3 * e, E);
            A[7 * place] = E[0] == 0.0 && E[1] == 0.0 && E[2] == 0.0;
        }
}

static void find_points(Contact *x)
{
    double way[3];
    point(&x->a, x->n, x->p_A), point(&x->b, x->n, x->p_B);
    for (int e = 0; e < 3; e++) way[e] = x->p_B[e] - x->p_A[e];
    x->g = dot(x->n, way);
}

/* Newton iterations for the normal of a contact without a face */
static void find_normal(Contact *x)
{
    for (int i = 0; i < MAX_NEWTON; i++) {
        double T[6], A[36], right[6], way[3];
        int pivots[6];
        find_points(x);
        tangents(x->n, T);
        for (int e = 0; e < 3; e++) way[e] = x->p_B[e] - x->p_A[e];
        for (int e = 0; e < 2; e++) {
            right[e] = dot(T + 3 * e, way);
            right[2 + e] = -dot(x->a.E + 3 * e, x->n), right[4 + e] = -dot(x->b.E + 3 * e, x->n);
        }
        newton_matrix(x, T, A);
        factor_solve(6, 1, A, right, pivots);
        double turn[3];
        for (int e = 0; e < 3; e++) turn[e] = right[0] * T[e] + right[1] * T[3 + e];
        const double size = sqrt(dot(turn, turn)), part = TURN / bigger(size, TINY);
        for (int e = 0; e < 3; e++) x->n[e] += (part < 1.0 ? part : 1.0) * turn[e];
        const double length = sqrt(dot(x->n, x->n));
        for (int e = 0; e < 3; e++) x->n[e] /= length;
        memcpy(x->beta, right + 4, sizeof x->beta);
        if (!(size > CONVERGED)) return;
    }
}

static void along(const double *normal, double *n)
{
    const double sign = dot(normal, n) < 0.0 ? -1.0 : 1.0;
    for (int e = 0; e < 3; e++) n[e] = sign * normal[e];
}

static Contact contact(const Plan *p, const Index *at, int i)
{
    const double *packed = p->live->features + (long)at->slot[i] * WIDTH;
    const double *const *pose_a = p->poses + 2 * at->body_a[i], *const *pose_b = p->poses + 2 * at->body_b[i];
    Contact x = {.vanished = packed[VANISHED]};
    x.a = side_of(packed, pose_a[0], pose_a[1], 1.0);
    x.b = side_of(packed + SIDE, pose_b[0], pose_b[1], -1.0);
    apply(pose_a[0], packed + NORMAL, x.n);
    if (x.a.is_face)
        along(x.a.face_normal, x.n);
    else if (x.b.is_face)
        along(x.b.face_normal, x.n);
    x.live = !x.a.is_face && !x.b.is_face;
    if (x.live) find_normal(&x);
    find_points(&x);
    return x;
}

double feature_gap(const Plan *p, const Index *at, int i, double *normal)
{
    const Contact x = contact(p, at, i);
    memcpy(normal, x.n, sizeof x.n);
    return x.vanished > 0.0 ? x.vanished : x.g;
}

/* derivatives of the normal (N) and of the contact point (P) by a displacement of B relative to A, 3 x 6 by columns */
static void turning(const Contact *x, const double *c, double *N, double *P)
{
    const double *n = x->n;
    double M[18] = {0}, S[18] = {0}, R_B[9] = {0}, change[3], turned[3];
    add_radii(&x->b, n, R_B);
    memset(N, 0, 18 * sizeof(double));
    for (int f = 0; f < 3; f++) {
        double axis[3] = {0.0, 0.0, 0.0};
        axis[f] = 1.0;
        M[4 * f] = 1.0;
        cross(axis, c, M + 3 * (3 + f));
        cross(axis, n, S + 3 * (3 + f)); /* phi x n */
    }
    const int follows = x->b.is_face && !x->a.is_face; /* the normal is that of a face of B */
    if (follows) memcpy(N, S, sizeof S);
    double sol[36] = {0};
    if (x->live) {
        double T[6], A[36];
        int pivots[6];
        tangents(n, T);
        for (int f = 0; f < 6; f++) {
            apply(R_B, S + 3 * f, turned);
            for (int e = 0; e < 3; e++) turned[e] += M[3 * f + e];
            for (int e = 0; e < 2; e++) {
                sol[6 * f + e] = dot(T + 3 * e, turned);
                sol[6 * f + 4 + e] = dot(x->b.E + 3 * e, S + 3 * f);
            }
        }
        newton_matrix(x, T, A);
        factor_solve(6, 6, A, sol, pivots);
        for (int f = 0; f < 6; f++)
            for (int e = 0; e < 3; e++) N[3 * f + e] = T[e] * sol[6 * f] + T[3 + e] * sol[6 * f + 1];
    }
    double R_A[9] = {0};
    if (follows) add_radii(&x->a, n, R_A);
    for (int f = 0; f < 6; f++) {
        double *out = P + 3 * f;
        if (follows) {
            apply(R_A, N + 3 * f, out);
            const double normal = dot(n, M + 3 * f);
            for (int e = 0; e < 3; e++) out[e] += n[e] * normal + x->g * N[3 * f + e];
            continue;
        }
        for (int e = 0; e < 3; e++) change[e] = S[3 * f + e] - N[3 * f + e];
        apply(R_B, change, out);
        for (int e = 0; e < 3; e++)
            out[e] += M[3 * f + e] - x->b.E[e] * sol[6 * f + 4] - x->b.E[3 + e] * sol[6 * f + 5];
    }
}

/* D V and D^T V of a row, and what the change of its wrench adds to the acceleration; drill is zero of other rows */
static double change(const Contact *x, const double *c, const double *d, double drill, int is_normal, const double *N,
                     const double *P, const double *V, double *DV, double *VD)
{
    memset(DV, 0, 6 * sizeof(double));
    for (int f = 0; f < 6; f++) {
        double D[6], by_P[3];
        const double away = dot(d, N + 3 * f);
        for (int e = 0; e < 3; e++) D[e] = is_normal ? N[3 * f + e] : -x->n[e] * away;
        cross(c, D, D + 3);
        cross(d, P + 3 * f, by_P);
        for (int e = 0; e < 3; e++) D[3 + e] += drill * N[3 * f + e] - by_P[e];
        VD[f] = dot6(D, V);
        for (int e = 0; e < 6; e++) DV[e] += D[e] * V[f];
    }
    return dot6(DV, V);
}

/* gap, frame, wrenches and motion of contact i, and what the change of the wrenches adds to the accelerations */
void find_feature(const Plan *p, const Table *t, const Index *at, int i, Rows *r)
{
    const Contact x = contact(p, at, i);
    const double *V_b = r->V + 6 * at->body_b[i], *V_a = r->V + 6 * at->body_a[i];
    double *c = r->c + 3 * i, *c_dot = r->c_dot + 3 * i, reference[3], frame[6], V[6], N[18], P[18], moves[6];
    r->g_N[i] = x.vanished > 0.0 ? x.vanished : x.g;
    memcpy(r->normals + 3 * i, x.n, sizeof x.n);
    memcpy(r->directions + 3 * i, x.n, sizeof x.n);
    for (int e = 0; e < 3; e++) {
        c[e] = x.b.is_face ? x.p_A[e] + x.g * x.n[e] : x.p_B[e];
        if (x.live) c[e] -= x.b.E[e] * x.beta[0] + x.b.E[3 + e] * x.beta[1];
    }
    apply(p->poses[2 * at->body_a[i]], t->tangent + 6 * i, reference);
    cross(reference, x.n, frame);
    const double size = bigger(sqrt(dot(frame, frame)), TINY);
    for (int e = 0; e < 3; e++) frame[e] /= size;
    cross(x.n, frame, frame + 3);
    for (int e = 0; e < 6; e++) V[e] = V_b[e] - V_a[e];
    memcpy(c_dot, V, 3 * sizeof(double));
    add_cross(V + 3, c, c_dot);
    cross(V_a + 3, V, moves);
    add_cross(V_a, V + 3, moves);
    cross(V_a + 3, V + 3, moves + 3);
    turning(&x, c, N, P);
    for (int row = 0; row < 1 + at->first_F[i + 1] - at->first_F[i]; row++) {
        const int f = at->first_F[i] + row - 1, u = row == 0 ? i : p->k + f;
        double *d = r->directions + 3 * u, *q = r->q + 3 * u, *F = r->wrench + 6 * u;
        const double drill = row == 0 ? 0.0 : t->drill_F[f];
        if (row > 0 && at->kind_F[f] < 2) memcpy(d, frame + 3 * at->kind_F[f], 3 * sizeof(double));
        for (int e = 0; e < 3; e++) q[e] = drill * x.n[e], F[e] = d[e];
        cross(c, d, F + 3); /* the point itself carries the force: no arm beyond it */
        for (int e = 0; e < 3; e++) F[3 + e] += q[e];
        const double turned = change(&x, c, d, drill, row == 0, N, P, V, r->DV + 6 * u, r->VD + 6 * u);
        r->acceleration[u] = turned - dot6(F, moves);
    }
}

/* gradients of a row's rate by the position and of its acceleration by the velocity, as wrenches on J */
void feature_gradients(const Index *at, int i, int u, const Rows *r, double *G_X, double *G_Y)
{
    const double *F = r->wrench + 6 * u, *VD = r->VD + 6 * u, *DV = r->DV + 6 * u;
    memcpy(G_X, VD, 6 * sizeof(double));
    add_force_cross(r->V + 6 * at->body_b[i], F, G_X);
    memcpy(G_Y, G_X, 6 * sizeof(double));
    for (int e = 0; e < 6; e++) G_Y[e] += DV[e];
    add_force_cross(r->V + 6 * at->body_a[i], F, G_Y);
}
