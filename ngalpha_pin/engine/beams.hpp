// Planar beams beside the bodies of a tree: their equations of motion, and their points, which are joints x, y and theta of
// the pinocchio::Model behind those of the tree. Twin of flexible/beams.py.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "kernel/kernel.hpp"

namespace nga {

// What a `PlanarBeam` fixes. Arrays by element, Gauss point and shape function or strain, the last one fastest.
struct BeamSection {
    int elements, gauss, functions;
    const double *first, *second;          // derivatives of the shape functions by the place on the centreline
    const double *stiffness, *reference;   // of stretch and turning, times the weight of the Gauss point; their rest
    double damping;                        // retardation time [s]
    int size() const { return 2 * (elements + functions - 1); }
};

// Adds the forces with which a beam resists its deformation at (q, v), and their derivatives, whose entries (i, j) are at
// [i + j * stride]; D is NULL where nobody asks.
void add_internal_forces(const BeamSection &beam, const double *q, const double *v, double *f, double *K, double *D,
                         long stride);

// One beam with arrays of its own.
struct BeamTable {
    int elements = 0, gauss = 0, functions = 0;
    std::vector<double> first, second, stiffness, reference;
    double damping = 0.0;
    std::vector<double> M;  // mass matrix in bands of LAPACK, by columns: entry (i, j) at [w + i - j + j (2 w + 1)]
    BeamSection section() const {
        return {elements, gauss, functions, first.data(), second.data(), stiffness.data(), reference.data(), damping};
    }
};

// Points of beams: place of the first coordinate of the control points that move each, numbers of shape functions, and the
// values of these and their derivatives, point after point.
struct BeamPoints {
    std::vector<int> first, functions;
    std::vector<double> N, dN;
};

class Beams {
public:
    Beams() = default;

    // load: gravity and dead forces, by coordinate; moments: at each point.
    Beams(std::vector<BeamTable> beams, BeamPoints points, std::vector<double> load, std::vector<double> moments);

    bool empty() const { return beams_.empty(); }
    int size() const { return static_cast<int>(load_.size()); }
    int points() const { return static_cast<int>(points_.first.size()); }

    // Puts (x, y, theta) of all points, their rates and second derivatives.
    void move(const double *q, const double *v, const double *a, double *x, double *u, double *u_dot);

    // Adds M a and the forces to the residual, and puts M, K and D, whose entries (i, j) are at [i + j * stride].
    void dynamics(const double *q, const double *v, const double *a, double *residual, double *M, double *K, double *D,
                  long stride) const;

    // The size of the coordinates of each beam, whose rounding its forces feel.
    void find_span(const double *q, double *span) const;

    // How the points follow the control points at the last motion, for the rows of the kernel.
    void show(kernel::Shapes &shapes) const;

private:
    std::vector<BeamTable> beams_;
    BeamPoints points_;
    std::vector<double> load_, moments_;
    std::vector<double> turning_, bend_, hessian_;  // of theta by its control points, of its rate by them; by (r')
};

}  // namespace nga
