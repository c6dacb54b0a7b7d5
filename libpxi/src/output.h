// Pixels in the form that a caller asks for.
#pragma once

#include "pxi.h"
#include "render.h"

namespace pxi {

// Bytes of a pixel of a pxi_format; refuses others.
size_t pixel_bytes(uint32_t format);

// A function that puts finished rectangles into a buffer whose rows begin `stride` bytes apart.
Put into(void *pixels, size_t stride, uint32_t format, bool opaque);

}  // namespace pxi
