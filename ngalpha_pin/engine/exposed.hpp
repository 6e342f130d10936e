// What of a polytope is surface, where other pieces of its body touch it; collision/pieces.py finds it.
#pragma once
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
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

// What of a piece is surface, found when it is asked for first: of thousands of pieces few are ever near anything.
class Beside {
public:
    using Found = std::shared_ptr<const Exposed>;
    explicit Beside(std::function<Found()> find) : find_(std::move(find)) {}
    const Exposed &get() const;

private:
    std::function<Found()> find_;
    mutable std::mutex mutex_;
    mutable Found found_;
    mutable std::atomic<const Exposed *> known_{nullptr};
};

}  // namespace nga
