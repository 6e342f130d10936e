// Strains of a rod in the axes of its section, with gradient and Hessian. With the centreline r(s) and a quaternion P(s)
// of any length, x = (r', P, P') and the frame R = R(P / |P|):
//     Gamma = R^T r',   kappa = axial vector of R^T R' = 2 vec(P* P') / |P|^2
// Both are quadratic forms of P over |P|^2. Quaternions are stored as (x, y, z, w).
// J. C. Simo, L. Vu-Quoc: A three-dimensional finite-strain rod model, part II, doi:10.1016/0045-7825(86)90079-4.
#pragma once
#include <Eigen/Core>

namespace nga {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector11 = Eigen::Matrix<double, 11, 1>;
using Gradient = Eigen::Matrix<double, 6, 11>;
using Hessian = Eigen::Matrix<double, 11, 11>;

struct Strains {
    Vector6 e;     // Gamma, kappa
    Gradient G;    // de/dx
    Hessian H[6];  // of each strain
};

// Strains at x.
Vector6 strains(const Vector11 &x);

// Strains at x with all derivatives.
void strains(const Vector11 &x, Strains &to);

}  // namespace nga
