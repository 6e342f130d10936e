/* Vectors of three and of six entries; a 3 x 3 matrix is stored by columns. */
#ifndef NGALPHA_PIN_VECTORS_H
#define NGALPHA_PIN_VECTORS_H

static inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double dot6(const double *a, const double *b)
{
    return (a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3]) + (a[4] * b[4] + a[5] * b[5]);
}

static inline void cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static inline void add_cross(const double *a, const double *b, double *c)
{
    double ab[3];
    cross(a, b, ab);
    for (int e = 0; e < 3; e++) c[e] += ab[e];
}

/* y = A x */
static inline void apply(const double *A, const double *x, double *y)
{
    for (int e = 0; e < 3; e++) y[e] = A[e] * x[0] + A[3 + e] * x[1] + A[6 + e] * x[2];
}

/* add the wrench of a force at a point, (force, point x force) */
static inline void add_wrench(const double *force, const double *point, double *F)
{
    for (int e = 0; e < 3; e++) F[e] += force[e];
    add_cross(point, force, F + 3);
}

/* add the change of a wrench that moves with the twist V: (omega x f, v x f + omega x tau) */
static inline void add_force_cross(const double *V, const double *F, double *G)
{
    add_cross(V + 3, F, G);
    add_cross(V, F, G + 3);
    add_cross(V + 3, F + 3, G + 3);
}

static inline double bigger(double a, double b) { return a > b ? a : b; }

#endif
