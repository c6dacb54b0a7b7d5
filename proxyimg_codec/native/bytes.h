// A layer of the pyramid whose inputs are activations, 0..255: products of bytes, where the machine
// sums four of them at once.
#pragma once

#include "linear.h"

namespace PXI_LEVEL {

#if defined(__AVX512BW__) || defined(__AVX2__) && !defined(__AVX512F__)

// Two sums of 16 bits for each output, which give its sum of 32 bits.
#if defined(__AVX512BW__)
typedef __m512i Halves;
static inline Halves product(int32_t inputs, ints weights) {
    return _mm512_maddubs_epi16(_mm512_set1_epi32(inputs), (__m512i)weights);
}
static inline Halves sum(Halves a, Halves b) { return _mm512_add_epi16(a, b); }
static inline ints joined(Halves sum) { return (ints)_mm512_madd_epi16(sum, _mm512_set1_epi16(1)); }
#else
typedef __m256i Halves;
static inline Halves product(int32_t inputs, ints weights) {
    return _mm256_maddubs_epi16(_mm256_set1_epi32(inputs), (__m256i)weights);
}
static inline Halves sum(Halves a, Halves b) { return _mm256_add_epi16(a, b); }
static inline ints joined(Halves sum) { return (ints)_mm256_madd_epi16(sum, _mm256_set1_epi16(1)); }
#endif

// Positions of which the sums, of 16 and of 32 bits, find room in registers, beside weights and an input.
constexpr int byte_side(int v) { return std::min(((LANES == 16 ? 32 : 16) - v - 1) / (2 * v), 8); }

// As `Linear`, for int8 weights. Sums of 16 bits hold few products: so the steps stand in runs of which
// the weights of one sign that meet in such a sum do not exceed MOST. A step that alone exceeds it
// becomes two, of half the weights each.
template <int V> class ByteLinear : public InTiles<ByteLinear<V>, uint8_t, ints, V, byte_side(V)> {
    static constexpr int MOST = 32767 / 255, PER_STEP = 4, SIDE = byte_side(V);
    typedef InTiles<ByteLinear<V>, uint8_t, ints, V, SIDE> Base;
    std::vector<int32_t> offsets;  // of the inputs of each step
    std::vector<int8_t> table;     // [outputs][steps][PER_STEP]

  public:
    using typename Base::Sums;
    using Base::blocks, Base::UNIT;

    ByteLinear(const std::vector<Stretch> &from, int n, const int32_t *bias_, int32_t more = 0)
        : Base(n), bias(blocks), runs(blocks) {
        for (const Stretch &s : from)
            for (int k = 0; k < s.count; k += PER_STEP) offsets.push_back((int32_t)s.offset + k);
        table.resize(blocks * UNIT * offsets.size() * PER_STEP);
        for (int o = 0; o < n; o++) ((int32_t *)bias.data())[o] = (bias_ ? bias_[o] : 0) + more;
    }
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
                if (Heights(weights).exceeds(Heights())) {
                    for (int k = 0; k < UNIT * PER_STEP; k++)
                        half[k] = weights[k] / 2, weights[k] = (int8_t)(weights[k] - half[k]);
                    add(runs[block], offsets[step], half);
                }
                add(runs[block], offsets[step], weights);
            }
    }

    // Not inlined, so that all pointers stay in registers.
    __attribute__((noinline)) void products(int block, const uint8_t *const *in, Sums *out) const {
        const uint8_t *from[SIDE];
        ints all[SIDE][V];
#pragma GCC unroll 8
        for (int p = 0; p < SIDE; p++) {
            from[p] = in[p];
#pragma GCC unroll 4
            for (int v = 0; v < V; v++) all[p][v] = bias[block].v[v];
        }
        for (const Run &run : runs[block]) {
            Halves sums[SIDE][V] = {};
            // Unrolled, gcc would begin all products at once, for which there are not enough registers.
#pragma GCC unroll 1
            for (const Step &step : run.steps) {
#pragma GCC unroll 8
                for (int p = 0; p < SIDE; p++) {
                    int32_t x;
                    std::memcpy(&x, from[p] + step.offset, sizeof x);
#pragma GCC unroll 4
                    for (int v = 0; v < V; v++) {
                        sums[p][v] = sum(sums[p][v], product(x, step.weights.v[v]));
                        asm("" : "+v"(sums[p][v]));  // no copies to other registers
                    }
                }
            }
#pragma GCC unroll 8
            for (int p = 0; p < SIDE; p++)
#pragma GCC unroll 4
                for (int v = 0; v < V; v++) {
                    all[p][v] += joined(sums[p][v]);
                    asm("" : "+v"(all[p][v]));
                }
        }
#pragma GCC unroll 8
        for (int p = 0; p < SIDE; p++)
#pragma GCC unroll 4
            for (int v = 0; v < V; v++) out[p].v[v] = all[p][v];
    }

  private:
    struct Heights {  // weights of either sign in each sum of 16 bits
        int16_t sums[2][UNIT * PER_STEP / 2] = {};
        Heights() = default;
        explicit Heights(const int8_t *weights) {
            for (int k = 0; k < UNIT * PER_STEP; k++)
                sums[weights[k] < 0][k / 2] = (int16_t)(sums[weights[k] < 0][k / 2] + std::abs(weights[k]));
        }
        bool exceeds(const Heights &before) const {  // together with others
            int over = 0;
            for (int sign = 0; sign < 2; sign++)
                for (int k = 0; k < UNIT * PER_STEP / 2; k++) over |= sums[sign][k] + before.sums[sign][k] > MOST;
            return over;
        }
        void add(const Heights &more) {
            for (int sign = 0; sign < 2; sign++)
                for (int k = 0; k < UNIT * PER_STEP / 2; k++)
                    sums[sign][k] = (int16_t)(sums[sign][k] + more.sums[sign][k]);
        }
    };
    struct Step {
        Sums weights;
        int32_t offset;
    };
    struct Run {
        std::vector<Step> steps;
        Heights heights;
    };
    std::vector<Sums> bias;              // [blocks]
    std::vector<std::vector<Run>> runs;  // [blocks]

    // Puts a step into a run that has room.
    void add(std::vector<Run> &to, int32_t offset, const int8_t *weights) {
        const Heights more(weights);
        auto run = std::find_if(to.begin(), to.end(), [&](const Run &r) { return !more.exceeds(r.heights); });
        if (run == to.end())
            run = to.insert(to.end(), {{}, more});
        else
            run->heights.add(more);
        run->steps.push_back({Sums::of((const int32_t *)weights), offset});
    }
};
typedef uint8_t Activation;
template <int V> using Active = ByteLinear<V>;
#else
typedef int16_t Activation;
template <int V> using Active = Linear<Whole, V>;
#endif

}  // namespace PXI_LEVEL
