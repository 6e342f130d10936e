// What of a disc and of a flat side lies above each other: where the rim crosses the sides, and what is inside.
#pragma once
#include <optional>

#include "flat_side.hpp"

namespace nga {

// Points of a disc, the cap `up` of the upper shape, over a face: the corners of the shape that are over it, crossings of
// its rim with the border, corners of the face, and of every arc of a rim inside a point of its own at least.
//   corners: those of the upper shape; kept: places that carry a force, those on the rim stay what they are
Corners disc_over(const Face &on, const Frame &frame, const Face &up, const Corners &corners,
                  const std::vector<Vector> &kept);

// Corners in order about the normal, cut to a disc.
Corners cut_to_disc(const Corners &ordered, const Face &on, const Frame &frame);

}  // namespace nga
