// What of a shape may come to rest on a face of another: its corners, cut to the face and reduced to a few.
#pragma once
#include <functional>
#include <optional>
#include <vector>

#include "features.hpp"

namespace nga {

// Tells of a point, and whether it is cut, if it is surface of both shapes; empty where all of both is.
using Felt = std::function<bool(const Vector &, bool)>;

// At most four of the corners, cut to a face, far from each other, deep ones first; none beside the face. And those at
// the points `kept`: what rests on a corner goes on to do so, whichever others are farther apart now.
//   up: the flat side of the upper shape above the face, if that is a disc
Corners resting_points(const Face &on, const Corners &corners, const std::optional<Face> &up,
                       const std::vector<Vector> &kept, const Felt &felt);

// Points at parts s of the way from corner a to corner b, of a surface with the outward normal m.
Corner between(const Corner &a, const Corner &b, double s, const Vector &m);

}  // namespace nga
