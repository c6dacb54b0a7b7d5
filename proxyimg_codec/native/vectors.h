// Vectors that operations take at a time, for all networks of the kernel.
#pragma once

#include <cstdint>

// The widest vectors that the machine has: gcc makes poor code of wider ones. A tile of TILE x 2
// vectors of sums, two of inputs and a factor fill the registers.
#if defined(__AVX512F__)
static const int LANES = 16, TILE = 8;
#elif defined(__AVX__)
static const int LANES = 8, TILE = 4;
#else
static const int LANES = 4, TILE = 4;
#endif
typedef float vec __attribute__((vector_size(4 * LANES)));
typedef int32_t ints __attribute__((vector_size(4 * LANES)));
typedef float vec8 __attribute__((vector_size(32), aligned(4), may_alias));  // anywhere in memory
