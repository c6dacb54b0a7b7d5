// The functions of the core that refine pyramids for the encoder. As in train.cpp, their results need not
// be the same on all levels, so they are compiled for speed; decoding needs nothing of them.

#include <cstdint>
#include <new>

#include "level.h"
#include "refine.h"
#include "refined_analysis.h"

using namespace PXI_LEVEL;

namespace {
template <class F> int guarded(F f) {
    try {
        f();
        return 0;
    } catch (const std::bad_alloc &) {
        return 1;
    }
}
}  // namespace

#pragma GCC visibility push(default)
extern "C" {

// Moves latents by one where that lowers the cost; see `Refiner::run`; 1 if there is not enough memory.
int PXI(refine)(const Refine *task) {
    return guarded([&] { Refiner(*task).run(); });
}

// Cost of latents and its slopes; 1 if there is not enough memory.
int PXI(refine_slopes)(const Refine *task) {
    return guarded([&] { Refiner(*task).derive(); });
}

// Bits of latents under shifts of the scales, [levels][2][16]; 1 if there is not enough memory.
int PXI(refine_tally)(const Refine *task) {
    return guarded([&] { Refiner(*task).tally(); });
}

// Coarser planes and bands of planes; 1 if there is not enough memory.
int PXI(pyramid_analysis)(const Analysis *task) {
    return guarded([&] { Analyser::all(*task); });
}

}  // extern "C"
