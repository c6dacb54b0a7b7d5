// The functions of the core that decoding and entropy coding need; train.cpp has those of training.
// Python calls them in kernel.py and the modules ..._native.py. Each header does one thing, and says
// which module of the package is its judge. Compiled once for each level, with sums as they stand here
// (setup.py): so all levels give the same pixels.

#include <algorithm>
#include <cstdint>
#include <new>

#include "arrays.h"
#include "completion.h"
#include "context.h"
#include "coverage.h"
#include "finish.h"
#include "level.h"
#include "lifting.h"
#include "network.h"
#include "sample.h"
#include "synthesis.h"

using namespace PXI_LEVEL;

// What some work says that went wrong. Without exceptions (WebAssembly) the program ends where memory does.
template <class Work> static int guarded(Work work) {
#if __cpp_exceptions
    try {
        return work();
    } catch (const std::bad_alloc &) {
        return NO_MEMORY;
    }
#else
    return work();
#endif
}

#pragma GCC visibility push(default)
extern "C" {

// Decodes an array; see `decode_symbols`.
int64_t PXI(decode)(const Coded *stream) { return decode_symbols(*stream); }

// Words that encoding gives, at the back of `words`; see `rans_encode`.
int64_t PXI(rans_encode)(const uint16_t *start, const uint16_t *freq, const int64_t *ends, int64_t groups,
                        int32_t scale_bits, int32_t lanes, uint32_t *states, uint16_t *words) {
    return rans_encode(start, freq, ends, groups, scale_bits, lanes, states, words);
}

// Decodes the lowest planes of a pyramid; what went wrong, if anything.
int PXI(pyramid_lowest)(Lowest *planes) {
    return guarded([&] { return decode_lowest(*planes); });
}

// Codes a level of a pyramid; what went wrong, if anything.
int PXI(pyramid_level)(Level *level) {
    return guarded([&] { return LevelCoder(*level).run(); });
}

// Planes that bands give by the plain wavelet; what went wrong, if anything.
int PXI(next_plain)(const Plain *planes) {
    return guarded([&] {
        Lifting(*planes).run();
        return NOTHING;
    });
}

// Synthesis of a level of a pyramid; what went wrong, if anything.
int PXI(pyramid_synthesis)(const Synthesis *level) {
    return guarded([&] { return Synthesizer(*level).run(); });
}

// Network output of `n` entries: out is [n][channels].
void PXI(forward)(const Net *net, const float *codes, const float *weights, const Entries *entries, int64_t n,
                 float *out) {
    Block block(*net);
    for (int64_t a = 0; a < n; a += BLOCK) {
        int count = (int)std::min<int64_t>(BLOCK, n - a);
        block.gather(codes, *entries, a, count, nullptr);
        block.forward(weights);
        for (int p = 0; p < count; p++)
            for (int c = 0; c < net->channels; c++)
                out[(a + p) * net->channels + c] = block.output()[c * BLOCK + p];
    }
}

// Samples at points, see `sample`; `channels` is 3 or 4.
void PXI(sample)(const float *samples, int64_t stride, int32_t channels, const Points *at, float *out) {
    if (channels == 3)
        sample<3>(samples, stride, *at, out);
    else
        sample<4>(samples, stride, *at, out);
}

// Colours of n samples of planes; see `coloured`.
void PXI(coloured)(const float *planes, const float *colours, int64_t n, float *out) {
    coloured(planes, colours, n, out);
}

// The same, in 0..1 and clamped; see `shown`.
void PXI(shown)(const float *planes, const float *colours, int64_t n, float *out) { shown(planes, colours, n, out); }

// Coverage of pixels; 0 where there are too many pieces, see `coverage`.
int PXI(coverage)(Cover *to, const int64_t *segments, const int64_t *log2, int64_t n) {
    return coverage(*to, segments, log2, n);
}

// Fills the unknown values of a plane; see `Diffusion`.
int PXI(diffused)(const Plane *plane, const uint8_t *done) {
    return guarded([&] {
        Diffusion().run(*plane, done);
        return NOTHING;
    });
}

// Completes a plane by references; see `complete`.
int PXI(completed)(Copies *copies) {
    return guarded([&] {
        complete(*copies);
        return NOTHING;
    });
}

// Puts colours behind what is there; see `blend`.
void PXI(blend)(float *result, float *clear, const float *colour, const float *coverage, int64_t n) {
    blend(result, clear, colour, coverage, n);
}

// Colours of n outputs; see `premultiplied`.
void PXI(premultiplied)(const float *output, int32_t channels, int64_t n, float *out) {
    premultiplied(output, channels, n, out);
}

// Colours of points that lie on samples; see `painted`.
void PXI(painted)(const Still *points) { painted(*points); }

// Layers that show the same samples; see `together`.
int PXI(together)(const Together *layers) {
    return guarded([&] {
        together(*layers);
        return NOTHING;
    });
}

// Output samples of `bits` 8 or 16; see `finished`.
void PXI(finished)(const float *samples, int32_t channels, int64_t n, int32_t components, int32_t bits, void *out) {
    if (bits == 8)
        finished(samples, channels, n, components, 255, (uint8_t *)out);
    else
        finished(samples, channels, n, components, 65535, (uint16_t *)out);
}

}  // extern "C"
