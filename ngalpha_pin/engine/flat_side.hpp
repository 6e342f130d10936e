// Flat sides of shapes and what lies over them, seen along the normal.
#pragma once
#include "features.hpp"

namespace nga {

using Flat = Eigen::Vector2d;

struct Frame {  // of a face
    Vector t1, t2, n;

    explicit Frame(const Vector &normal) : n(normal) { tangents(n, t1, t2); }
    Flat flat(const Vector &x) const { return {x.dot(t1), x.dot(t2)}; }
    Flat place(const Corner &x) const { return flat(x.support(-n)); }
};

struct Border {  // a side of a polygon: places x with inwards . x >= offset are inside
    Flat inwards;
    double offset;
};

std::vector<Border> borders(const Face &on, const Frame &frame);

}  // namespace nga
