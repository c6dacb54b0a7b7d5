// Pictures that are as they were encoded: their samples, or thumbnails of only the levels that these need (REN-18).
#pragma once

#include "render.h"

namespace pxi {

// Draws a view of one raster, as large as it is or smaller; false if it shows anything else than samples of one, each on its pixel. Nothing
// must have moved beside a layer that is drawn.
bool thumbnail(Image &image, const Request &request, const Pixels &to, Told told);

}  // namespace pxi
