// The kernel, for C++.
#pragma once

namespace nga::kernel {
extern "C" {
#include "kernel.h"
void nga_begin_step(const Plan *p, double *step);
void nga_rebound(const Plan *p, double *step, double *rows);
void nga_find_gaps(const Plan *p, double *g_N, double *normals);
double nga_evaluate(const Plan *p, double *step, double *iterate, double *rows);
void nga_linearise(const Plan *p, double *step, double *rows);
void nga_advance(const Plan *p, double *step, double *iterate, double *next);
int nga_solve(const Plan *p, double *step, double *iterate, double *rows, double *next);
int nga_correct(const Plan *p, double *step, double *iterate, double *rows, double *next);
int nga_sweep(const int *sizes, const int *first_F, const int *start, const int *row, const double *value,
              const double *diagonal, const double *mu, const double *lower, const double *upper, const double *limits,
              double *state, double *P, double *y);
void nga_step_sizes(const Plan *p, int *sizes);
void nga_iterate_sizes(const Plan *p, int *sizes);
void nga_rows_sizes(const Plan *p, int *sizes);
void nga_work_sizes(const Plan *p, int *sizes);
}
}  // namespace nga::kernel
