// Samples of a view for what does not show, and at its edge (PYR-42, PYR-47 to PYR-52).
#pragma once

#include "occlusion.h"

namespace pxi {

constexpr int FILL_ONE = 65280;  // the integer that stands for the sample 1

// Straight components [h * w] of a part, alpha last if there is any.
typedef std::vector<std::vector<float>> Components;

// Gives components of colour in a greater number: grey stands for three.
void even_out(Components &colours, size_t count);

// The same of what lies behind: `others` with alpha last, if `values` have one, and which samples are there.
struct Behind {
    Components values;
    Mask there;
};

// Values of hidden samples; those that are known by `trusted` stay. `behind` may be null.
Components filled(const Texr &texr, const Components &own, Mask trusted, const Behind *behind);

// Replaces components at the edge of a view; `mixed` are those of the raster, without alpha.
void unmix(const Edge &edge, const Components &mixed, Components &values, int w, int h);

}  // namespace pxi
