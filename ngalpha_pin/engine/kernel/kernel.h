/* Compiled twin of the numpy step: contact/point_rows.py (rows.c), contact/feature_rows.py (features.c),
 * constraints/frame_rows.py and driven_angle.py (frames.c), constraints/joint_coupling.py
 * and joint_trajectory.py (couplings.c), flexible/beams.py (points.c),
 * contact/laws.py (laws.c), contact/joint_friction.py (joints.c), step/equations.py (step.c) and step/newton_matrix.py (newton.c). The Python files are the
 * reference; names here are theirs.
 *
 * All numbers of a call live in a few flat blocks of doubles. The lists below are the only place that knows what is in
 * them; binding.py asks for the names and sizes. nv: velocity coordinates, nu: those of the joints, which differ where
 * there are beams, nw: nu there and zero elsewhere, nb: bodies, k: contacts, m: friction rows,
 * j = k + m, n_c = k + 2 j: their rows and multipliers; nf: joint coordinates with dry friction; kb, mb: rows of
 * constraints on position and velocity level, b = kb + mb; l = j + nf + b, n = n_c + 2 nf + kb + 2 b: rows and
 * multipliers of all. Matrices of a block are stored column by column.
 */
#ifndef NGALPHA_PIN_KERNEL_H
#define NGALPHA_PIN_KERNEL_H

/* all other functions stay inside: the C library has an `advance` of its own */
#define EXPORT __attribute__((visibility("default")))

/* what a `Subset` fixes, from the array attributes of the same name */
#define TABLE_FIELDS(F)                                                                                                \
    F(point, 3 * k) F(radius, k) F(normal, 3 * k) F(offset, k) F(centre, 3 * k) F(axis, 3 * k) F(surface_radius, k)    \
    F(half_length, k) F(side, k) F(tangent, 6 * k) F(drill_F, m) F(mu, k) F(e, k + m) F(limit_sign, k) F(limit_value, k) F(lower, nf) F(upper, nf) F(sign, k * nu) F(support, nb * nu)
/* integers: likewise; slot is the place of the features of a contact, -1 of a point; limit_q is where the coordinate of a limit is in q, -1 of a point; at_g, at_v and at_a are the multipliers (and equations) of the rows of g, rate and acceleration */
#define INDEX_FIELDS(F)                                                                                                \
    F(body_b, k) F(body_a, k) F(curved, k) F(moving, k) F(first_F, k + 1) F(kind_F, m) F(scale_rows, n) F(levels, n)   \
    F(slot, k) F(limit_q, k) F(limit_dof, k) F(dofs, nf) F(row_g, k + kb) F(at_g, k + kb) F(at_v, l) F(at_a, l)
/* one step: numbers of the method and of the system, the start of the step, what `begin_step` makes of them, scales; and
 * the index sets A, B, C, stick and stick_a where they are prescribed, and slack, see `ContactResidual` */
#define STEP_FIELDS(F)                                                                                                 \
    F(dt, 1) F(alpha_f, 1) F(alpha_m, 1) F(gamma, 1) F(beta, 1) F(tol, 1) F(weight, 1) F(ALPHA_R, 1) F(ROUNDING, 1)    \
    F(SINGULAR, 1) F(FORGET, 1) F(EDGE, 1) F(paper, 1) F(displaces, 1) F(accelerates, 1) F(loaded, 1) F(flat, 1) F(monotone, 1) \
    F(span, nv) F(a, nv) F(a_bar, nv) F(v, nv) F(la, k + m) F(la_bar, k + m) F(tau_f, nf) F(tau_f_bar, nf) F(c, 1) F(gamma_c, 1) F(beta_c, 1) F(known, nv + k + m + nf) F(friction_known, nf)      \
    F(motion, 1) F(v_free, nv) F(dq_free, nv) F(z_known, n_c) F(kappa_F_known, m) F(start_rates, k + m) F(scaled, 1) F(r, n) F(by_dof, 3 * nv)      \
    F(kinematic, n) F(direct, n) F(row_scale, n) F(column_scale, n) F(force_scale, k) F(prescribed, 1) F(sets, 5 * k) F(slackened, 1) F(slack, k)
/* one iterate: small, since states are views of it */
#define ITERATE_FIELDS(F)                                                                                              \
    F(x, 3 * nv + n) F(v, nv) F(dq, nv) F(spent, 1) F(a_bar, nv) F(la_bar, k + m) F(z, n_c) F(keep, k) F(bar_f, nf) F(P_f, nf)
/* its rows and laws */
#define ROWS_FIELDS(F)                                                                                                 \
    F(residual, nv) F(g_N, k) F(normals, 3 * k) F(c, 3 * k) F(c_dot, 3 * k) F(omega, 3 * k) F(V, 6 * nb)               \
    F(bend, 9 * k) F(h, 3 * k) F(directions, 3 * (k + m)) F(q, 3 * (k + m)) F(wrench, 6 * (k + m)) F(turn, 3 * (k + m))     \
    F(DV, 6 * (k + m)) F(VD, 6 * (k + m)) F(W, l * nv) F(rate, l) F(acceleration, l) F(R, 3 * nv) F(y, n) F(ratio, k) F(share, m)              \
    F(R_c, n) F(holds, n) F(A, k) F(B, k) F(C, k) F(stick, k) F(stick_a, k) F(slips, 1) F(size_v, m) F(cap, m)         \
    F(capped, m) F(unit_v, m) F(norm_v, m) F(unit_c, m) F(norm_c, m) F(unit_a, m) F(norm_a, m) F(g, kb)                \
    F(d_f, 3 * b) F(c_f, 3 * b) F(n_f, 3 * b) F(b_f, 3 * b) F(wrench_f, 6 * b) F(V_a, 6 * b) F(V_b, 6 * b)             \
    F(by_rho, b) F(c_dot_f, 3 * b) F(e_dot, 3 * b) F(b_dot, 3 * b) F(sizes_f, 2) F(V_joints, 12 * b) F(follows, nf) F(W_u, l * nw)
/* work space of one correction, overwritten by the next */
#define WORK_FIELDS(F)                                                                                                 \
    F(T, nv * nv) F(M, nv * nv) F(K, nv * nv) F(D, nv * nv) F(S, nv * nv) F(X, l * nv) F(Y, l * nv)        \
    F(E, l * n) F(by_M, nv * (l + 2)) F(Z, 3 * nv * (n + 1)) F(H, n * (n + 1)) F(J, n * (n + 1))             \
    F(wide_v, nv * (n + 1)) F(wide_q, nv * (n + 1)) F(rows, l * (n + 3)) F(column, n + nv) F(A, n * n)            \
    F(LU, n * n) F(b, n) F(y, n) F(pivots, n + nv) F(X_u, l * nw) F(Y_u, l * nw)

#define DOUBLES(name, size) double *name;
#define INTS(name, size) int *name;
typedef struct { TABLE_FIELDS(DOUBLES) } Table;
typedef struct { INDEX_FIELDS(INTS) } Index;
typedef struct { STEP_FIELDS(DOUBLES) } Step;
typedef struct { ITERATE_FIELDS(DOUBLES) } Iterate;
typedef struct { ROWS_FIELDS(DOUBLES) } Rows;
typedef struct { WORK_FIELDS(DOUBLES) } Work;

/* a matrix that Pinocchio or numpy owns: entry (i, j) is at[i * row + j * column] */
typedef struct {
    const double *at;
    long row, column;
} Matrix;

/* what Pinocchio writes in place, and the sums over the force laws of the scene */
typedef struct {
    const double *J, *dJ, *dAdv; /* 6 x nv by columns */
    const double *residual, *tau, *reach, *q;
    const double *features; /* packed rows of all places, see collision/features.py */
    Matrix M, K, D, K_forces, D_forces;
    const struct Frames *frames;
    const struct Shapes *shapes; /* NULL without beams */
} Live;

/* rows that tie frames to each other, those of g first, from the attributes of a `FrameTable` of the same name; `a` and
 * `b` are places in `poses`, which has rotation and translation of each of nj joints */
typedef struct Frames {
    int n, kb, nj;
    const int *kind, *a, *b, *group;
    const double *vector_a, *point_a, *point_b, *vector_b, *length, *support;
    const double *const *poses;
    double unit;     /* least size of what the rows subtract */
    double vanishes; /* inverse mass of a group, in parts of the largest one, that is none */
    /* nc rows of g behind them couple joints: their sums of joint coordinates, followers first, then leaders, whose parts
     * are places in q, or -1 - place where the angle of (cosine, sine) counts, with factors; powers of the leader */
    int nc;
    const int *first_part, *part, *first_power;
    const double *factor, *power, *turn, *rows; /* rows: derivatives of the sums, 2 nc x nv; turn: period of a gap */
    /* of each of these n + nc rows the place among `wanted` of what it follows over time, -1 where that is nothing: three
     * numbers each, the value at the end of the step and its two derivatives */
    const int *follows;
    const double *wanted;
} Frames;

/* points of beams, which are three joints each behind those of the tree: of each, the place of its first control point
 * among the coordinates behind the tree, how many shape functions move it, and their values, derivatives of its angle and
 * of the rate of its angle; then velocities and accelerations of all joints */
typedef struct Shapes {
    int count, nt; /* nt: velocity coordinates of the tree */
    const int *first, *functions;
    const double *N, *turning, *bend, *u, *u_dot;
} Shapes;

/* a subset of one system */
typedef struct {
    int nv, nb, k, m, nf, kb, mb, nu, nw;
    const Live *live;
    const double *const *poses; /* rotation (by columns) and translation of each body */
    double *table, *work;
    int *index;
} Plan;

/* pointers into the blocks, for the functions below to start with */
#define SIZES(p)                                                                                                       \
    const int nv = (p)->nv, nb = (p)->nb, k = (p)->k, m = (p)->m, nf = (p)->nf, kb = (p)->kb, mb = (p)->mb, nu = (p)->nu, nw = (p)->nw, \
              b = kb + mb, j = k + m, l = j + nf + b, n_c = k + 2 * j, n = n_c + 2 * nf + kb + 2 * b
#define UNUSED_SIZES (void)nv, (void)nu, (void)nw, (void)nb, (void)j, (void)b, (void)l, (void)n_c, (void)n
Table table_of(const Plan *p);
Index index_of(const Plan *p);
Step step_of(const Plan *p, double *block);
Iterate iterate_of(const Plan *p, double *block);
Rows rows_of(const Plan *p, double *block);
Work work_of(const Plan *p);

/* rows.c */
void find_rows(const Plan *p, const double *v, const double *a, Rows *r);
void find_derivatives(const Plan *p, const Rows *r, double *X, double *Y);
/* points.c */
void into_coordinates(const Plan *p, const double *of_joints, double *rows);
void derivatives_into_coordinates(const Plan *p, const Rows *r, const Work *w);
/* features.c */
double feature_gap(const Plan *p, const Index *at, int i, double *normal);
void find_feature(const Plan *p, const Table *t, const Index *at, int i, Rows *r);
void feature_gradients(const Index *at, int i, int u, const Rows *r, double *G_X, double *G_Y);
/* joints.c */
void find_joint_rows(const Plan *p, const double *v, const double *a, Rows *r);
void find_joint_laws(const Plan *p, const Step *s, Iterate *it, Rows *r);
void joint_jacobian(const Plan *p, const Rows *r, int column, double *J);
/* frames.c */
void find_frame_rows(const Plan *p, const double *v, const double *a, Rows *r);
void find_frame_derivatives(const Plan *p, const Rows *r, double *X, double *Y);
/* couplings.c */
void follow(const Frames *f, int i, int first, Rows *r);
void find_coupling_rows(const Plan *p, const double *v, const double *a, Rows *r);
void find_coupling_derivatives(const Plan *p, const Rows *r, double *X, double *Y);
/* laws.c */
void find_laws(const Plan *p, const Step *s, Iterate *it, Rows *r);
void laws_jacobian(const Plan *p, const Step *s, const Iterate *it, const Rows *r, const double *H, double *dz, double *J);
/* newton.c */
void find_stiffness(const Plan *p, const Step *s, const Work *w);
/* step.c */
double entry(const Matrix *A, int i, int l);
int has_carried(const Step *s, int i);
double kappa_c(const Step *s, int i);
void copy_matrix(const Matrix *A, int n, double *to);
void nga_move(const Plan *p, double *step, double *iterate);
void find_forces(const Plan *p, const Step *s, Iterate *it, Rows *r, double *kappa_F);
void put_scales(const Plan *p, const Step *s, const Iterate *it, const Rows *r, const double *G, const double *M, const double *h, const double *stiffness);
double find_error(const Plan *p, const Step *s, const Rows *r);
void find_bars(const Plan *p, const Step *s, Iterate *it, const Rows *r);
/* solve.c */
int cholesky_solve(int n, int columns, double *M, double *right);
int factor_solve(int n, int columns, double *A, double *right, int *pivots);
void add_product(int rows, int inner, int columns, const double *A, const double *B, int ldb, double *C, int ldc);

#endif
