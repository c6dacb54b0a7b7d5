// Distributions of latents (PYR-11), and the feature G of their magnitudes (PYR-18).
#pragma once

#include <vector>

#include "core.h"

namespace pxi {

constexpr int LATENT_LIMIT = 1 << 16;  // bound of the magnitude of latents

// Made once; all is constant.
const loops::Tables &latent_tables();
const std::vector<int32_t> &log_features();

}  // namespace pxi
