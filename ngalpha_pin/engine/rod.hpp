// The internal forces of a rod in space: elements of three nodes (r, p) with two Gauss points each, forces as the exact
// gradient of the quadrature of the strain energy, and viscous ones of Kelvin and Voigt.
#pragma once
#include <Eigen/Core>
#include <vector>

#include "rod_strains.hpp"

namespace nga {

class Rod {
public:
    // places: of the nodes along the rod, increasing, 2 elements + 1. stiffness: of the section, 6 x 6. reference: pose
    // (r, p) of the nodes of the undeformed rod, p a unit quaternion (x, y, z, w). damping: [s].
    Rod(std::vector<double> places, std::vector<double> stiffness, const std::vector<double> &reference, double damping);

    int elements() const { return static_cast<int>(places_.size() - 1) / 2; }
    int nodes() const { return static_cast<int>(places_.size()); }
    // Length of the undeformed rod along each element.
    std::vector<double> lengths() const;

    // Strain energy of the rod with its nodes at x, 7 numbers each.
    double energy(const double *x) const;
    // Power of the viscous forces, not positive; v: 6 numbers a node, velocity in the world and angular velocity in the body.
    double damping_power(const double *x, const double *v) const;
    // Section forces (N, Q_y, Q_z, M_x, M_y, M_z) at the Gauss points, elements x 2 x 6.
    void section_forces(const double *x, const double *v, double *to) const;
    // Places of the Gauss points along the rod, elements x 2.
    std::vector<double> gauss_places() const;
    // Subtracts the internal forces from tau (6 a node) and their derivatives by q and v from K and D, by columns with
    // `stride` numbers each.
    void subtract(const double *x, const double *v, double *tau, double *K, double *D, int stride) const;

private:
    using Dofs = Eigen::Matrix<double, 11, 18>;
    struct Element {  // quaternions with one sign, as its nodes are
        Eigen::Vector3d r[3];
        Eigen::Vector4d p[3];
    };
    struct Point {
        double weight;     // of the quadrature times the undeformed length
        double N[3], N_s[3];  // shape functions and derivatives by the undeformed length
        Vector6 e;         // strains of the undeformed rod
    };
    Element element(int e, const double *x) const;
    static Vector11 at(const Point &point, const Element &nodes);
    static Dofs rates(const Point &point, const Element &nodes);
    static Dofs rates_by_q(const Point &point, const Element &nodes, const double *v);

    std::vector<double> places_;
    Matrix6 stiffness_;
    double damping_;
    std::vector<Point> points_;  // two an element
};

}  // namespace nga
