/* Linear algebra of the step: LAPACK and BLAS, through the pointers that scipy exports. */
#include <string.h>

#include "kernel.h"

typedef void (*Dgesv)(int *, int *, double *, int *, int *, double *, int *, int *);
typedef void (*Dposv)(char *, int *, int *, double *, int *, double *, int *, int *);
typedef void (*Dgemm)(
    char *, char *, int *, int *, int *, double *, double *, int *, double *, int *, double *, double *, int *);
static Dgesv dgesv;
static Dposv dposv;
static Dgemm dgemm;

EXPORT void nga_use_lapack(void *dgesv_pointer, void *dposv_pointer, void *dgemm_pointer)
{
    memcpy(&dgesv, &dgesv_pointer, sizeof dgesv);
    memcpy(&dposv, &dposv_pointer, sizeof dposv);
    memcpy(&dgemm, &dgemm_pointer, sizeof dgemm);
}

/* right becomes M^-1 right; M is overwritten. The result is LAPACK's: 0 where M is positive definite */
int cholesky_solve(int n, int columns, double *M, double *right)
{
    char upper = 'U';
    int info;
    dposv(&upper, &n, &columns, M, &n, right, &n, &info);
    return info;
}

/* right becomes A^-1 right; A is overwritten by its factors. The result is LAPACK's: 0 where no pivot vanishes */
int factor_solve(int n, int columns, double *A, double *right, int *pivots)
{
    int info;
    dgesv(&n, &columns, A, &n, pivots, right, &n, &info);
    return info;
}

/* C += A B; the columns of B and C are ldb and ldc apart. In a small product zeros of B cost nothing; a call of BLAS
 * costs as much as about two thousand multiplications */
void add_product(int rows, int inner, int columns, const double *A, const double *B, int ldb, double *C, int ldc)
{
    if ((long)rows * inner * columns > 2000) {
        char plain = 'N';
        double one = 1.0;
        dgemm(&plain, &plain, &rows, &columns, &inner, &one, (double *)A, &rows, (double *)B, &ldb, &one, C, &ldc);
        return;
    }
    for (int c = 0; c < columns; c++) {
        double *restrict out = C + (long)c * ldc;
        for (int i = 0; i < inner; i++) {
            const double factor = B[(long)c * ldb + i], *restrict column = A + (long)i * rows;
            if (factor == 0.0) continue;
            for (int r = 0; r < rows; r++) out[r] += factor * column[r];
        }
    }
}
