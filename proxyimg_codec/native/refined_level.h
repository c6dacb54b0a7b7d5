// A level of a pyramid that is being refined: its weights, as Python gives them, and what is kept of it
// from one evaluation to the next. That is little: the networks are not trained, so the way back needs
// nothing of a hidden layer but which of its units were within their bounds, a bit each.
#pragma once

#include "lifting.h"
#include "rates.h"

namespace PXI_LEVEL {

struct RefinedWeights {  // [out][in].., float32; biases are those at the step in use
    const float *first, *first_bias, *second, *second_bias, *causal, *mix, *mix_bias, *luma, *luma_bias, *from_luma,
        *from_luma_bias, *chroma, *chroma_bias;                                      // the context network
    const float *linear, *in, *in_bias, *between, *between_bias, *out, *out_bias;    // the synthesis
    const float *gain;                                                               // [9]
    int32_t context, hidden;                                                         // widths
    float shifts[2];                                                                 // of the log scale
};

static const int CAUSAL = 12;           // neighbours that the context sees: two rows of five, and two beside
static const float ACTIVE = 255 / 32.f;  // bound of activations of the context network

typedef Rows<float> Floats;

// A bit for each hidden unit of each position: whether the gradient passes it.
struct Passed {
    Rows<int32_t> words;
    Passed() {}
    Passed(int units, int width, int count) : words((units + 31) / 32, width, count) {}
    static ints *at(int32_t *p) { return (ints *)p; }
    void mark(int y, int unit, int x, ints yes) {
        near_ints *to = (near_ints *)(words(y, unit / 32) + x);
        *to |= yes & (int32_t)(1u << unit % 32);
    }
    vec of(int y, int unit, int x, vec gradient) const {
        const ints word = *(const near_ints *)(words(y, unit / 32) + x);
        return chosen((word & (int32_t)(1u << unit % 32)) != 0, gradient, (vec){});
    }
    typedef int32_t near_ints __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
};

struct RefinedLevel {
    RefinedWeights weights;
    int h, w, rows, columns;      // rows and columns of the finer planes
    Floats latents;               // [9]
    Floats bends;                 // [3] what a move adds to the error, in squares of the gain
    Floats support, may;          // [9] 1 for latents that are coded, or that may move; or of no channels
    Floats last, best;            // [9] last move of each latent; [1] most that one of a position gains
    Floats plain, low;            // [3] planes that the plain wavelet and the synthesis give
    Floats slopes;                // [18] by the outputs of the context network
    Floats up, down;              // [9] cost of a move of the latent, but for what follows from the slope; see `weigh`
    Floats by_latents, by_plain, by_low;       // [9], [3], [3] slopes of the cost
    Floats by_inputs[2];          // [3] by the high passes of plain and low, before they are spread
    Floats cells, by_wide;        // [12] slopes by the samples that the synthesis gives; by what it filters
    Passed first, second, mix, luma, in, between;
    Rows<uint8_t> busy;           // [1] whether a latent of a position is not 0

    RefinedLevel(const RefinedWeights &weights, int rows, int columns)
        : weights(weights), h((rows + 1) / 2), w((columns + 1) / 2), rows(rows), columns(columns), latents(9, w, h),
          bends(3, w, h), last(9, w, h), best(1, w, h), plain(3, w, h), low(3, w, h), slopes(18, w, h), up(9, w, h), down(9, w, h), by_latents(9, w, h),
          by_plain(3, w, h), by_low(3, w, h), by_inputs{Floats(3, w, h), Floats(3, w, h)}, cells(12, w, h),
          by_wide(12, w + 4, h + 4), first(weights.context, w, h), second(weights.context, w, h),
          mix(weights.context, w, h), luma(weights.context, w, h), in(weights.hidden, w, h),
          between(weights.hidden, w, h), busy(1, w, h) {}
};

// Row y of planes less the mean of 3 x 3 around, with edges repeated. This is its own transpose.
static inline void high_pass(const Floats &planes, int c, int y, int h, float *out) {
    const int w = planes.width;
    const float *middle = planes(y, c), *up = planes(std::max(y - 1, 0), c), *down = planes(std::min(y + 1, h - 1), c);
    const auto column = [&](int x) { return up[x] + middle[x] + down[x]; };
    for (int x = 1; x < w - 1; x++) out[x] = middle[x] - (column(x - 1) + column(x) + column(x + 1)) * (1 / 9.f);
    for (int x : {0, w - 1})
        out[x] = middle[x] - (column(std::max(x - 1, 0)) + column(x) + column(std::min(x + 1, w - 1))) * (1 / 9.f);
}

// x / (1 + |x| / bound), and its derivative.
static inline vec bounded(vec x, float bound) { return x / (1.f + absolute(x) * (1 / bound)); }
static inline vec by_bounded(vec x, float bound) {
    const vec under = 1.f + absolute(x) * (1 / bound);
    return 1.f / (under * under);
}
// ln(1 + |x|), and its derivative.
static inline vec logged(vec x) { return logarithm(1.f + absolute(x)); }
static inline vec by_logged(vec x) {
    const vec sized = 1.f / (1.f + absolute(x));
    return chosen(x > 0.f, sized, chosen(x < 0.f, -sized, (vec){}));
}

}  // namespace PXI_LEVEL
