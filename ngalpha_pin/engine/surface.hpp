// Whether a contact is between surfaces, where bodies are made of pieces that touch each other; see collision/pieces.py.
#pragma once
#include "face_clipping.hpp"
#include "solid.hpp"

namespace nga {

struct Placed {
    const Solid &solid;
    const Pose &at;
};

// For a point of the shape `above` over the face `on` of the shape `below`; empty where both are surface everywhere.
Felt surface_test(const Face &on, const Placed &below, const Placed &above);

// The features of a packed row, of which one is a corner or both are edges, are surface.
bool row_is_surface(const Solid &a, const Solid &b, const Pose &X, const Row &row);

}  // namespace nga
