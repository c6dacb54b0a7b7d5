// The functions of the kernel that Python calls (kernel.py and the modules ..._native.py). All is one
// translation unit: each header does one thing, and says which module of the package is its judge.
// Decoding needs none of train.h and what only that includes.

#include <algorithm>
#include <cstdint>
#include <new>

#include "arrays.h"
#include "context.h"
#include "coverage.h"
#include "network.h"
#include "sample.h"
#include "synthesis.h"
#include "train.h"

extern "C" {

// Decodes an array; see `decode_symbols`.
int64_t pxi_decode(const Coded *stream) { return decode_symbols(*stream); }

// Words that encoding gives, at the back of `words`; see `rans_encode`.
int64_t pxi_rans_encode(const uint16_t *start, const uint16_t *freq, const int64_t *ends, int64_t groups,
                        int32_t scale_bits, int32_t lanes, uint32_t *states, uint16_t *words) {
    return rans_encode(start, freq, ends, groups, scale_bits, lanes, states, words);
}

// Codes a level of a pyramid; what went wrong, if anything.
int pxi_pyramid_level(Level *level) {
    try {
        return LevelCoder(*level).run();
    } catch (const std::bad_alloc &) {
        return NO_MEMORY;
    }
}

// Synthesis of a level of a pyramid; what went wrong, if anything.
int pxi_pyramid_synthesis(const Synthesis *level) {
    try {
        return Synthesizer(*level).run();
    } catch (const std::bad_alloc &) {
        return NO_MEMORY;
    }
}

// Network output of `n` entries: out is [n][channels].
void pxi_forward(const Net *net, const float *codes, const float *weights, const Entries *entries, int64_t n,
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
void pxi_sample(const float *samples, int64_t stride, int32_t channels, const Points *at, float *out) {
    if (channels == 3)
        sample<3>(samples, stride, *at, out);
    else
        sample<4>(samples, stride, *at, out);
}

// Coverage of pixels; 0 where there are too many pieces, see `coverage`.
int pxi_coverage(Cover *to, const int64_t *segments, const int64_t *log2, int64_t n) {
    return coverage(*to, segments, log2, n);
}

// Puts colours behind what is there; see `blend`.
void pxi_blend(float *result, float *clear, const float *colour, const float *coverage, int64_t n) {
    blend(result, clear, colour, coverage, n);
}

// Takes `steps` steps of training; `pixels` is [steps][batch]. Returns their mean loss.
double pxi_train(const Train *task, const int32_t *pixels, int64_t steps, int64_t batch, int64_t done,
                 const float *lr_codes, const float *lr_weights) {
    return Training(*task, {pixels, steps, batch, done, lr_codes, lr_weights}).run();
}

}  // extern "C"
