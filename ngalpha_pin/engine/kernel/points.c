/* Twin of flexible/beams.py: rows in the coordinates of tree and beams from those of the joints, W = W_u T. */
#include <stddef.h>
#include <string.h>

#include "kernel.h"

/* rows += of_joints times the derivatives of the angles or of their rates, and of the places where N is given */
static void add_points(const Plan *p, const double *of_joints, const double *N, const double *turning, double factor, double *rows)
{
    SIZES(p);
    UNUSED_SIZES;
    const Shapes *of = p->live->shapes;
    for (int o = 0, first = 0; o < of->count; first += of->functions[o++])
        for (int i = 0; i < 2 * of->functions[o]; i++) {
            const double *place = of_joints + (size_t)(of->nt + 3 * o + i % 2) * l, *angle = of_joints + (size_t)(of->nt + 3 * o + 2) * l;
            const double moves = N ? N[first + i / 2] : 0.0, turns = factor * turning[2 * first + i];
            double *to = rows + (size_t)(of->nt + of->first[o] + i) * l;
            for (int u = 0; u < l; u++) to[u] += moves * place[u] + turns * angle[u];
        }
}

void into_coordinates(const Plan *p, const double *of_joints, double *rows)
{
    SIZES(p);
    UNUSED_SIZES;
    const Shapes *of = p->live->shapes;
    const size_t of_tree = (size_t)l * of->nt;
    memcpy(rows, of_joints, of_tree * sizeof(double));
    memset(rows + of_tree, 0, ((size_t)l * nv - of_tree) * sizeof(double));
    add_points(p, of_joints, of->N, of->turning, 1.0, rows);
}

/* X = X_u T + W_u du/dq, Y = Y_u T + W_u du_dot/dv */
void derivatives_into_coordinates(const Plan *p, const Rows *r, const Work *w)
{
    const Shapes *of = p->live->shapes;
    into_coordinates(p, w->X_u, w->X);
    into_coordinates(p, w->Y_u, w->Y);
    add_points(p, r->W_u, NULL, of->bend, 1.0, w->X);
    add_points(p, r->W_u, NULL, of->bend, 2.0, w->Y);
}
