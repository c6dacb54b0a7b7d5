// Pixels in the form that a caller asks for.
#pragma once

#include "geometry.h"
#include "pxi.h"

namespace pxi {

// Bytes of a pixel of a pxi_format; refuses others.
size_t pixel_bytes(uint32_t format);

// A buffer whose rows begin `stride` bytes apart.
struct Pixels {
    void *at;
    size_t stride;
    uint32_t format;
    bool opaque;  // whether all alphas are 1

    // Puts a rectangle of finished samples: premultiplied [height][width][4], or opaque [height][width][3].
    // Called by any thread, of different rectangles at once.
    void put(const Box &box, const float *samples, int channels) const;
};

}  // namespace pxi
