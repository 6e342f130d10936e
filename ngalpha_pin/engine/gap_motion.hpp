// Bound of the change of gaps; see `ContactTable.motion`.
#pragma once
#include <vector>

namespace nga {

// In a scene with pairs of solids; without any it is empty, and the kernel has a bound of its own.
struct GapMotion {
    // Which velocity coordinates move each body with contacts, bodies x nv, and which of these bodies are in pairs of
    // points and surfaces; limits of coordinates with the distance that one of them moves points [m].
    std::vector<double> support;
    std::vector<int> bodies_a, bodies_b, limits;
    std::vector<double> measure;
    int nv = 0;

    bool empty() const { return nv == 0; }

    // Bound of the change of any gap of points and limits along a tangent step.
    double most(const double *dq, const std::vector<double> &reach) const;
};

}  // namespace nga
