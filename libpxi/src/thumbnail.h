// Thumbnails of pictures that are as they were encoded: only the levels that they need (REN-18).
#pragma once

#include "render.h"

namespace pxi {

// Draws a small view of one raster; false if it shows anything else than samples of one, each on its pixel. Nothing
// must have moved beside a layer that is drawn.
bool thumbnail(Image &image, const Request &request, const Put &put, const Told &told);

}  // namespace pxi
