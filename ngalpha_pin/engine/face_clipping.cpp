// Four points that are far from each other carry whatever rests there.
#include "face_clipping.hpp"

#include <algorithm>
#include <numeric>

namespace nga {
namespace {

using Flat = Eigen::Vector2d;
constexpr std::size_t POINTS = 4;

struct Frame {  // of a face
    Vector t1, t2, n;

    explicit Frame(const Vector &normal) : n(normal) { tangents(n, t1, t2); }
    Flat flat(const Vector &x) const { return {x.dot(t1), x.dot(t2)}; }
    Flat place(const Corner &x) const { return flat(x.support(-n)); }
};

double cross(const Flat &a, const Flat &b) { return a.x() * b.y() - a.y() * b.x(); }

double extent(const std::vector<Flat> &places) {
    Flat low = places[0], high = places[0];
    for (const Flat &x : places) low = low.cwiseMin(x), high = high.cwiseMax(x);
    return (high - low).maxCoeff();
}

// Corners of the hull of points in the plane, in order (monotone chains).
std::vector<int> convex_order(const std::vector<Flat> &places) {
    std::vector<int> order(places.size()), found;
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int i, int j) {
        return places[i].x() != places[j].x() ? places[i].x() < places[j].x() : places[i].y() < places[j].y();
    });
    const double size = extent(places), least = 1e-12 * size * size;
    for (int turn : {0, 1}) {
        std::vector<int> chain;
        for (int i : order) {
            while (chain.size() > 1) {
                const Flat &a = places[chain[chain.size() - 2]], &b = places[chain.back()];
                if (cross(b - a, places[i] - b) > least) break;
                chain.pop_back();
            }
            chain.push_back(i);
        }
        if (chain.size() > 1) found.insert(found.end(), chain.begin(), chain.end() - 1);
        if (turn == 0) std::reverse(order.begin(), order.end());
    }
    std::vector<int> once;
    for (int i : found)
        if (std::find(once.begin(), once.end(), i) == once.end()) once.push_back(i);
    return once;
}

struct Border {  // a side of a polygon: places x with inwards . x >= offset are inside
    Flat inwards;
    double offset;
};

std::vector<Border> borders(const Face &on, const Frame &frame) {
    const std::size_t n = on.corners.size();
    std::vector<Flat> start(n);
    for (std::size_t i = 0; i < n; ++i) start[i] = frame.flat(on.corners[i]);
    std::vector<Border> found;
    double longest = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        const Flat side = start[(i + 1) % n] - start[i];
        longest = std::max(longest, side.cwiseAbs().maxCoeff());
        const Flat inwards = Flat(-side.y(), side.x()) / std::max(side.norm(), TINY);
        found.push_back({inwards, inwards.dot(start[i])});
    }
    // a corner on a side, up to rounding, is inside: faces of one width would lose their corners to each other
    for (Border &border : found) border.offset -= ON_SIDE * longest;
    return found;
}

// Corners in order about -n or n, cut by one side.
Corners cut(const Corners &corners, const std::vector<double> &depth, bool closed, const Vector &n) {
    const std::size_t size = corners.size();
    Corners found;
    for (std::size_t i = 0; i < size; ++i) {
        const std::size_t j = (i + 1) % size;
        if (depth[i] >= 0.0) found.push_back(corners[i]);
        if ((!closed && j == 0) || (depth[i] >= 0.0) == (depth[j] >= 0.0)) continue;
        const double s = depth[i] / (depth[i] - depth[j]);
        // a cut through a corner is that corner
        if (s > 1e-9 && s < 1 - 1e-9) found.push_back(between(corners[i], corners[j], s, -n));
    }
    return found;
}

Corners clip(Corners corners, const std::vector<Border> &sides, const Frame &frame) {
    const bool closed = corners.size() > 2;
    std::vector<Flat> first;
    for (const Corner &x : corners) first.push_back(frame.place(x));
    for (const Border &side : sides) {
        const auto outside = [&](const Flat &x) { return x.dot(side.inwards) < side.offset; };
        if (std::none_of(first.begin(), first.end(), outside)) continue;  // what is inside at first stays inside
        std::vector<double> depth;
        for (const Corner &x : corners) depth.push_back(frame.place(x).dot(side.inwards) - side.offset);
        if (std::all_of(depth.begin(), depth.end(), [](double d) { return d >= 0.0; })) continue;
        corners = cut(corners, depth, closed, frame.n);
        if (corners.empty()) break;
    }
    return corners;
}

// The corners above a face, cut to it.
Corners above(const Face &on, const Corners &corners, const Frame &frame) {
    std::vector<Flat> places;
    int lowest = 0;
    double least = INFINITY;
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const Vector x = corners[i].support(-frame.n);
        places.push_back(frame.flat(x));
        if (x.dot(frame.n) < least) least = x.dot(frame.n), lowest = static_cast<int>(i);
    }
    std::vector<int> order(corners.size());
    std::iota(order.begin(), order.end(), 0);
    if (places.size() > 2) order = convex_order(places);
    const std::vector<Border> sides = borders(on, frame);
    Corners ordered;
    for (int i : order) ordered.push_back(corners[i]);
    Corners found = clip(std::move(ordered), sides, frame);
    // the lowest one may be in the middle of the others
    if (std::find(order.begin(), order.end(), lowest) == order.end()) {
        const Corners alone = clip({corners[lowest]}, sides, frame);
        found.insert(found.end(), alone.begin(), alone.end());
    }
    return found;
}

// Four points that are far from each other: the deepest, the farthest from it, the widest on either side.
std::vector<char> spread(const std::vector<Flat> &places, const std::vector<double> &heights) {
    const double low = *std::min_element(heights.begin(), heights.end()) + 1e-9 * extent(places);
    const std::size_t n = places.size();
    std::size_t first = 0, second = 0, left = 0, right = 0;
    while (!(heights[first] < low)) {
        if (++first == n) {
            first = 0;
            break;
        }
    }
    for (std::size_t i = 0; i < n; ++i)
        if ((places[i] - places[first]).squaredNorm() > (places[second] - places[first]).squaredNorm()) second = i;
    const Flat d = places[second] - places[first];
    const auto side = [&](std::size_t i) { return cross(d, places[i] - places[first]); };
    for (std::size_t i = 0; i < n; ++i) {
        if (side(i) > side(left)) left = i;
        if (side(i) < side(right)) right = i;
    }
    std::vector<char> chosen(n, 0);
    for (std::size_t i : {first, second, left, right}) chosen[i] = 1;
    return chosen;
}

}  // namespace

Corner between(const Corner &a, const Corner &b, double s, const Vector &m) {
    const bool same = a.r == b.r && a.Q == b.Q;
    const Vector first = same ? a.c : a.support(m), last = same ? b.c : b.support(m);
    return {(1.0 - s) * first + s * last, same ? a.Q : Matrix(Matrix::Zero()), same ? a.r : 0.0, true};
}

Corners resting_points(const Face &on, const Corners &corners, const std::vector<Vector> &kept, const Felt &felt) {
    if (corners.empty()) return {};
    const Frame frame(on.normal);
    Corners found = on.corners.empty() ? corners : above(on, corners, frame);
    if (felt) {
        const auto is_none = [&](const Corner &x) { return !felt(x.support(-on.normal), x.cut); };
        found.erase(std::remove_if(found.begin(), found.end(), is_none), found.end());
    }
    if (found.size() <= POINTS) return found;
    std::vector<Flat> places;
    std::vector<double> heights;
    Vector low = Vector::Constant(INFINITY), high = -low;
    for (const Corner &x : found) {
        const Vector p = x.support(-on.normal);
        places.push_back(frame.flat(p)), heights.push_back(p.dot(on.normal));
        low = low.cwiseMin(p), high = high.cwiseMax(p);
    }
    std::vector<char> chosen = spread(places, heights);
    const double near = ON * (high - low).maxCoeff();
    for (const Vector &p : kept) {
        const auto away = [&](std::size_t i) { return (found[i].c - p).cwiseAbs().maxCoeff(); };
        std::size_t nearest = 0;
        for (std::size_t i = 1; i < found.size(); ++i)
            if (away(i) < away(nearest)) nearest = i;
        if (away(nearest) < near) chosen[nearest] = 1;
    }
    Corners few;
    for (std::size_t i = 0; i < found.size(); ++i)
        if (chosen[i]) few.push_back(found[i]);
    return few;
}

}  // namespace nga
