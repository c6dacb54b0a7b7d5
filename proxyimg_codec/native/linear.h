// Linear layers at many positions: what the networks of the pyramid are made of.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "level.h"
#include "vectors.h"

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__wasm_simd128__)
#include <wasm_simd128.h>
#endif

namespace PXI_LEVEL {

// Whole numbers: int16 inputs and weights, taken two at a time by the machine's multiply-add of
// pairs, where it has one.
struct Whole {
    typedef int16_t Number;
    typedef int32_t Sum, Step;  // Step: PER_STEP inputs
    typedef ints Vector;
    static constexpr int PER_STEP = 2;
    static Vector add(Vector sum, Step inputs, Vector weights) {
#if defined(__AVX512BW__)
        return sum + (ints)_mm512_madd_epi16(_mm512_set1_epi32(inputs), (__m512i)weights);
#elif defined(__AVX2__) && !defined(__AVX512F__)
        return sum + (ints)_mm256_madd_epi16(_mm256_set1_epi32(inputs), (__m256i)weights);
#elif defined(__SSE2__) && !defined(__AVX__)
        return sum + (ints)_mm_madd_epi16(_mm_set1_epi32(inputs), (__m128i)weights);
#elif defined(__wasm_simd128__)
        return sum + (ints)wasm_i32x4_dot_i16x8(wasm_i32x4_splat(inputs), (v128_t)weights);
#else
        return sum + (weights << 16 >> 16) * (int32_t)(int16_t)inputs + (weights >> 16) * (inputs >> 16);
#endif
    }
};
struct Real {
    typedef float Number, Sum, Step;
    typedef vec Vector;
    static constexpr int PER_STEP = 1;
    static Vector add(Vector sum, Step input, Vector weights) { return sum + input * weights; }
};

struct Stretch {  // of memory: its start from a position's own place, and how many inputs it holds
    int64_t offset;
    int count;
};

// The side x side neighbours of a position, from the upper left one, in rows of `length` numbers.
static std::vector<Stretch> square(int side, int channels, int64_t length) {
    std::vector<Stretch> out;
    for (int y = 0; y < side; y++) out.push_back({y * length, side * channels});
    return out;
}

// Vectors are copied one by one: what is stored in parts would have to reach memory before it is read.
template <class Vector, int V> struct Vectors {
    Vector v[V];
    Vectors() = default;
    Vectors(const Vectors &from) { *this = from; }
    Vectors &operator=(const Vectors &from) {
        for (int k = 0; k < V; k++) v[k] = from.v[k];
        return *this;
    }
    template <class Number> static Vectors of(const Number *from) {
        Vectors out;
        for (int k = 0; k < V; k++) std::memcpy(&out.v[k], from + k * LANES, sizeof(Vector));
        return out;
    }
    template <class Number> void put(Number *to) const {
        for (int k = 0; k < V; k++) std::memcpy(to + k * LANES, &v[k], sizeof(Vector));
    }
};

// What layers have in common: outputs are computed V vectors at a time, for SIDE positions.
template <class Layer, class Input, class Vector, int V, int SIDE> struct InTiles {
    typedef Input Number;
    typedef Vectors<Vector, V> Sums;
    static constexpr int UNIT = V * LANES;
    const int blocks;

    static int padded(int n) { return (n + UNIT - 1) / UNIT * UNIT; }
    explicit InTiles(int outputs) : blocks(padded(outputs) / UNIT) {}
    int outputs() const { return blocks * UNIT; }

    // Calls out(i, first output, Sums) for each place in(i), i < n.
    template <class In, class Out> void operator()(int n, In in, Out out) const {
        for (int i = 0; i < n; i += SIDE) {
            const Number *from[SIDE];
            for (int p = 0; p < SIDE; p++) from[p] = in(std::min(i + p, n - 1));
            for (int block = 0; block < blocks; block++) {
                Sums sums[SIDE];
                ((const Layer *)this)->products(block, from, sums);
                for (int p = 0; p < std::min(SIDE, n - i); p++) out(i + p, block * UNIT, sums[p]);
            }
        }
    }
};

// A layer whose inputs lie in a few stretches of memory around each position.
template <class Kind, int V>
class Linear : public InTiles<Linear<Kind, V>, typename Kind::Number, typename Kind::Vector, V, TILE> {
    typedef InTiles<Linear<Kind, V>, typename Kind::Number, typename Kind::Vector, V, TILE> Base;
    typedef typename Kind::Number Number;
    typedef typename Kind::Sum Sum;
    std::vector<Stretch> stretches;
    int steps = 0;

  public:
    using typename Base::Sums;
    using Base::blocks, Base::UNIT;

    Linear(std::vector<Stretch> from, int n, const Sum *bias_, Sum more = 0) : Base(n), stretches(std::move(from)) {
        for (const Stretch &s : stretches) steps += s.count / Kind::PER_STEP;
        weights.resize((size_t)blocks * steps), bias.resize(blocks);
        for (int o = 0; o < n; o++) ((Sum *)bias.data())[o] = (bias_ ? bias_[o] : 0) + more;
    }
    void set(int input, int output, Sum weight, Sum zero = 0) {  // zero: the input that adds nothing
        ((Sum *)bias.data())[output] -= weight * zero;
        Sums &at = weights[(size_t)(output / UNIT) * steps + input / Kind::PER_STEP];
        ((Number *)&at)[output % UNIT * Kind::PER_STEP + input % Kind::PER_STEP] = (Number)weight;
    }
    void ready() {}  // to be called when all weights are set

    // Not inlined, so that all pointers stay in registers.
    __attribute__((noinline)) void products(int block, const Number *const *in, Sums *out) const {
        const Sums *weight = weights.data() + (size_t)block * steps;
        Sums sums[TILE];
        // Without the pragmas gcc keeps the sums in memory.
#pragma GCC unroll 8
        for (int p = 0; p < TILE; p++) sums[p] = bias[block];
        for (const Stretch &s : stretches) {
            const Number *from[TILE];
#pragma GCC unroll 8
            for (int p = 0; p < TILE; p++) from[p] = in[p] + s.offset;
            for (int k = 0; k < s.count; k += Kind::PER_STEP, weight++) {
                const Sums w = *weight;
#pragma GCC unroll 8
                for (int p = 0; p < TILE; p++) {
                    typename Kind::Step x;
                    std::memcpy(&x, from[p] + k, sizeof x);
#pragma GCC unroll 4
                    for (int v = 0; v < V; v++) sums[p].v[v] = Kind::add(sums[p].v[v], x, w.v[v]);
                }
            }
        }
#pragma GCC unroll 8
        for (int p = 0; p < TILE; p++) out[p] = sums[p];
    }

  private:
    std::vector<Sums> weights, bias;  // [blocks][steps], [blocks]
};

}  // namespace PXI_LEVEL
