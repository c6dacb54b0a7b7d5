// A layer of the pyramid whose inputs are activations, 0..255: products of bytes, where the machine
// sums four of them at once.
#pragma once

#include "linear.h"

namespace PXI_LEVEL {

#if defined(__AVX512BW__) || defined(__AVX2__) && !defined(__AVX512F__)

// Two sums of 16 bits for each output, which give its sum of 32 bits.
#if defined(__AVX512BW__)
typedef __m512i Halves;
static inline Halves added(Halves sum, int32_t inputs, ints weights) {
    return _mm512_add_epi16(sum, _mm512_maddubs_epi16(_mm512_set1_epi32(inputs), (__m512i)weights));
}
static inline ints joined(Halves sum) { return (ints)_mm512_madd_epi16(sum, _mm512_set1_epi16(1)); }
#else
typedef __m256i Halves;
static inline Halves added(Halves sum, int32_t inputs, ints weights) {
    return _mm256_add_epi16(sum, _mm256_maddubs_epi16(_mm256_set1_epi32(inputs), (__m256i)weights));
}
static inline ints joined(Halves sum) { return (ints)_mm256_madd_epi16(sum, _mm256_set1_epi16(1)); }
#endif

// As `Linear`, for int8 weights. Sums of 16 bits hold few products: so the steps stand in runs of which
// the weights of one sign that meet in such a sum do not exceed MOST. A step that alone exceeds it
// becomes two, of half the weights each.
template <int V> class ByteLinear {
    static constexpr int MOST = 32767 / 255, PER_STEP = 4, RUN = 4;  // RUN: steps
    std::vector<int32_t> offsets;  // of the inputs of each step
    std::vector<int8_t> table;     // [outputs][steps][PER_STEP]
    int blocks;

  public:
    typedef uint8_t Number;
    static constexpr int UNIT = V * LANES;
    typedef Vectors<ints, V> Sums;
    static int padded(int n) { return (n + UNIT - 1) / UNIT * UNIT; }

    ByteLinear(const std::vector<Stretch> &from, int n, const int32_t *bias_, int32_t more = 0)
        : blocks(padded(n) / UNIT), bias(blocks), runs(blocks) {
        for (const Stretch &s : from)
            for (int k = 0; k < s.count; k += PER_STEP) offsets.push_back((int32_t)s.offset + k);
        table.resize(blocks * UNIT * offsets.size() * PER_STEP);
        for (int o = 0; o < n; o++) ((int32_t *)bias.data())[o] = (bias_ ? bias_[o] : 0) + more;
    }
    int outputs() const { return blocks * UNIT; }
    void set(int input, int output, int32_t weight, int32_t zero = 0) {  // zero: the input that adds nothing
        ((int32_t *)bias.data())[output] -= weight * zero;
        table[output * offsets.size() * PER_STEP + input] = (int8_t)weight;
    }
    void ready() {
        for (int block = 0; block < blocks; block++)
            for (size_t step = 0; step < offsets.size(); step++) {
                int8_t weights[UNIT * PER_STEP], half[UNIT * PER_STEP];
                for (int o = 0; o < UNIT; o++)
                    std::memcpy(weights + o * PER_STEP,
                                table.data() + ((block * UNIT + o) * offsets.size() + step) * PER_STEP, PER_STEP);
                if (!Heights().hold(weights)) {
                    for (int k = 0; k < UNIT * PER_STEP; k++)
                        half[k] = weights[k] / 2, weights[k] = (int8_t)(weights[k] - half[k]);
                    add(runs[block], offsets[step], half);
                }
                add(runs[block], offsets[step], weights);
            }
    }

    // Calls out(i, first output, Sums) for each place in(i), i < n.
    template <class In, class Out> void operator()(int n, In in, Out out) const {
        for (int i = 0; i < n; i += TILE) {
            const uint8_t *from[TILE];
            for (int p = 0; p < TILE; p++) from[p] = in(std::min(i + p, n - 1));
            for (int block = 0; block < blocks; block++) {
                Sums sums[TILE];
                products(block, from, sums);
                for (int p = 0; p < std::min(TILE, n - i); p++) out(i + p, block * UNIT, sums[p]);
            }
        }
    }

  private:
    struct Heights {  // weights of one sign in each sum of 16 bits
        int sums[UNIT * PER_STEP / 2][2] = {};
        bool hold(const int8_t *weights) {  // more weights, if they can
            Heights after = *this;
            for (int k = 0; k < UNIT * PER_STEP; k++)
                if ((after.sums[k / 2][weights[k] < 0] += std::abs(weights[k])) > MOST) return false;
            *this = after;
            return true;
        }
    };
    struct Run {
        Sums weights[RUN];
        int32_t offsets[RUN], count;
        Heights heights;
    };
    std::vector<Sums> bias;              // [blocks]
    std::vector<std::vector<Run>> runs;  // [blocks]

    // Puts a step into a run that has room; what is left of a run adds nothing.
    void add(std::vector<Run> &to, int32_t offset, const int8_t *weights) {
        const auto has_room = [&](Run &run) { return run.count < RUN && run.heights.hold(weights); };
        auto run = std::find_if(to.begin(), to.end(), has_room);
        if (run == to.end()) {
            to.emplace_back();
            run = to.end() - 1;
            run->heights.hold(weights);
        }
        run->offsets[run->count] = offset;
        run->weights[run->count++] = Sums::of((const int32_t *)weights);
    }

    // Not inlined, so that all pointers stay in registers.
    __attribute__((noinline)) void products(int block, const uint8_t *const *in, Sums *out) const {
        const uint8_t *from[TILE];
#pragma GCC unroll 8
        for (int p = 0; p < TILE; p++) from[p] = in[p], out[p] = bias[block];
        for (const Run &run : runs[block]) {
            Halves sums[TILE][V] = {};
            // Unrolled, gcc would begin all products at once, for which there are not enough registers.
#pragma GCC unroll 1
            for (int k = 0; k < RUN; k++) {
                const int32_t offset = run.offsets[k];
#pragma GCC unroll 8
                for (int p = 0; p < TILE; p++) {
                    int32_t x;
                    std::memcpy(&x, from[p] + offset, sizeof x);
#pragma GCC unroll 4
                    for (int v = 0; v < V; v++) {
                        sums[p][v] = added(sums[p][v], x, run.weights[k].v[v]);
                        asm("" : "+v"(sums[p][v]));  // no copies to other registers
                    }
                }
            }
#pragma GCC unroll 8
            for (int p = 0; p < TILE; p++)
#pragma GCC unroll 4
                for (int v = 0; v < V; v++) out[p].v[v] += joined(sums[p][v]);
        }
    }
};
typedef uint8_t Activation;
template <int V> using Active = ByteLinear<V>;
#else
typedef int16_t Activation;
template <int V> using Active = Linear<Whole, V>;
#endif

}  // namespace PXI_LEVEL
