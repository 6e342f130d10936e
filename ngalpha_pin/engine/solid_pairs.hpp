// Pairs of solids that are proven to be apart, from spheres around them and from the last looks at their distances.
// Twin of `Proximity` of collision/broad_phase.py, as far as it does not look at a distance itself.
#pragma once
#include <vector>

#include "mechanism.hpp"

namespace nga {

// What a scene fixes, from the attributes of `Proximity`; a and b are joints.
struct SolidPairs {
    std::vector<int> a, b;
    std::vector<double> centres_a, centres_b, size_b, radii, walls, two_sided, doubt, extent;
    // Which velocity coordinates move each body with contacts, bodies x nv, and which of these bodies are in pairs of
    // points and surfaces; limits of coordinates with the distance that one of them moves points [m].
    std::vector<double> support;
    std::vector<int> bodies_a, bodies_b, limits;
    std::vector<double> measure;
    int nv = 0;

    bool empty() const { return a.empty(); }

    // Bound of the change of any gap of points and limits along a tangent step; see `ContactTable.motion`.
    double motion(const double *dq, const std::vector<double> &reach) const;
};

// What the looks so far have found; the arrays stay with the caller.
struct Looks {
    const double *found = nullptr, *x = nullptr, *R = nullptr;  // of all pairs: distance, centre and axes (by rows) of B
    const double *seen_R = nullptr, *seen_p = nullptr;          // of all joints at the last look at all pairs, by rows
    std::vector<int> listed;                                    // pairs that are looked at since
    double others_from = -1.0;                                  // how far the others were [m]
};

// Whether every pair is farther apart than it can approach within a time `ahead` at the velocities of the mechanism,
// which stands at them.
bool all_apart(const SolidPairs &pairs, const Looks &looks, const Mechanism &mechanism, double ahead);

}  // namespace nga
