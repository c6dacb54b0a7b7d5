// What a caller asks for: checked and completed, as render/view.py and render/pixels.py do it.
#pragma once

#include "pxi.h"
#include "render.h"

namespace pxi {

// `limits` are those that the file was opened with.
Request requested(const Image &image, const pxi_request &asked, const Limits &limits);

// Changes limits by their names.
void set_limits(Limits &limits, const pxi_limit *changes, uint32_t count);

}  // namespace pxi
