// What of a polytope is surface, where other pieces of its body touch it; collision/pieces.py finds it.
#pragma once
#include <vector>

#include "features.hpp"

namespace nga {

struct Exposed {
    struct Part {  // of an edge: its start, the way to its end, and the normals between which it is felt
        Vector first, way, low, high;
    };
    double tol, near;
    std::vector<Vector> V;
    std::vector<char> faces, corners;
    std::vector<Part> parts;
    std::vector<std::vector<Vector>> blocked;  // of every corner the ways to the corners of other pieces there

    // The corner or edge that p lies on is surface in the direction of the outward unit normal n. On neither of them p
    // lies in a face, and is.
    bool felt(const Vector &p, const Vector &n) const;
};

}  // namespace nga
