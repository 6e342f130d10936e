#include "exposed.hpp"

#include <algorithm>

namespace nga {
namespace {

constexpr double ARC = 1e-9;  // of collision/exposed.py

}  // namespace

bool Exposed::felt(const Vector &p, const Vector &n) const {
    std::size_t nearest = 0;
    double least = INFINITY;
    for (std::size_t i = 0; i < V.size(); ++i) {
        const double away = (V[i] - p).squaredNorm();
        if (away < least) least = away, nearest = i;
    }
    if (least <= near * near) {
        const std::vector<Vector> &ways = blocked[nearest];
        return corners[nearest] && std::all_of(ways.begin(), ways.end(), [&](const Vector &w) { return w.dot(n) <= 2.0 * tol; });
    }
    bool here = false;
    for (const Part &part : parts) {
        const Vector from = p - part.first;
        const double s = from.dot(part.way) / std::max(part.way.squaredNorm(), TINY);
        if ((from - std::min(std::max(s, 0.0), 1.0) * part.way).squaredNorm() > near * near) continue;
        here = true;
        const Vector axis = part.low.cross(part.high);
        const double size = axis.norm();
        if (size > 0.0 && part.low.cross(n).dot(axis) >= -ARC * size && n.cross(part.high).dot(axis) >= -ARC * size) return true;
    }
    return !here;
}

const Exposed &Beside::get() const {
    if (known_.load() == nullptr) {
        Found found = find_();  // outside of the lock: it may wait for Python, which another thread holds
        const std::lock_guard<std::mutex> lock(mutex_);
        if (known_.load() == nullptr) found_ = std::move(found), known_.store(found_.get());
    }
    return *known_.load();
}

}  // namespace nga
