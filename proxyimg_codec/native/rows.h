// Rows of planes, and convolutions of them: what the refinement of a pyramid is made of. A row holds
// its channels one after the other, so that vectors run along positions and no channel is wasted.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "sums.h"

namespace PXI_LEVEL {

static inline vec absolute(vec v) { return (vec)((ints)v & 0x7fffffff); }
static inline vec chosen(ints mask, vec a, vec b) { return (vec)((mask & (ints)a) | (~mask & (ints)b)); }
static inline vec least(vec a, vec b) { return a < b ? a : b; }
static inline vec most(vec a, vec b) { return a > b ? a : b; }
static inline float added(vec v) {
    float sum = 0;
    for (int i = 0; i < LANES; i++) sum += v[i];
    return sum;
}

// Rows [count][channels][pitch]; beside each there is room for what filters reach, which is 0.
// A ring if there are fewer than the plane has: row y then stands in place of row y - count.
template <class T> class Rows {
    std::vector<T> data;

  public:
    static constexpr int BESIDE = 16;
    int channels, width, pitch, count;
    Rows() : channels(0), width(0), pitch(0), count(1) {}
    Rows(int channels, int width, int count)
        : data((size_t)count * channels * (padded(width) + 2 * BESIDE)), channels(channels), width(width),
          pitch(padded(width) + 2 * BESIDE), count(count) {}
    static int padded(int n) { return (n + LANES - 1) / LANES * LANES; }
    T *operator()(int y) { return data.data() + (int64_t)((y + count) % count) * channels * pitch + BESIDE; }
    const T *operator()(int y) const { return const_cast<Rows &>(*this)(y); }
    T *operator()(int y, int c) { return (*this)(y) + (int64_t)c * pitch; }
    const T *operator()(int y, int c) const { return (*this)(y) + (int64_t)c * pitch; }
    void clear(int y) { std::fill_n((*this)(y) - BESIDE, (int64_t)channels * pitch, T()); }
    void clear() { std::fill(data.begin(), data.end(), T()); }
    void trim(int y) {  // what stands beside a row, on its right, is 0 again
        for (int c = 0; c < channels; c++) std::fill((*this)(y, c) + width, (*this)(y, c) + pitch - BESIDE, T());
    }
};

// Weights and biases of a convolution as the model has them: [outputs][inputs][taps].
struct Kernel {
    const float *weights;
    int outputs, inputs, taps;
    // Of the transpose: what the gradient goes back through, with taps in the same order.
    std::vector<float> transposed() const {
        std::vector<float> out((size_t)outputs * inputs * taps);
        for (int o = 0; o < outputs; o++)
            for (int i = 0; i < inputs; i++)
                for (int t = 0; t < taps; t++)
                    out[((size_t)i * outputs + o) * taps + t] = weights[((size_t)o * inputs + i) * taps + t];
        return out;
    }
};

// A sum over terms: out[o] = bias[o] + sum over k of weight[o][k] * in[k], at each position of a row.
// Which row, channel and shift a term reads is up to the caller's table of pointers.
class Sum {
    static constexpr int OUTS = 4, WIDE = 3;  // fills 16 registers
    std::vector<float> weights, biases;       // [blocks][terms][OUTS], [blocks][OUTS]

    template <int V, class Out> void block(const float *const *in, int used, int x, Out &out) const {
        vec sums[OUTS * V];
        for (int b = 0; b < blocks; b++) {
            const float *const own = weights.data() + (size_t)b * terms * OUTS;
            const auto term = [in, own](int k) { return Term{in[k], own + k * OUTS}; };
            add_terms<OUTS, V>(term, used, x, biases.data() + b * OUTS, sums);
            for (int o = 0; o < OUTS && b * OUTS + o < outputs; o++)
                for (int j = 0; j < V; j++) out(b * OUTS + o, x + j * LANES, sums[o * V + j]);
        }
    }

  public:
    int terms = 0, outputs = 0, blocks = 0;
    Sum() {}
    Sum(int outputs, int terms, const float *bias = nullptr)
        : weights((size_t)(outputs + OUTS - 1) / OUTS * OUTS * terms), biases((outputs + OUTS - 1) / OUTS * OUTS),
          terms(terms), outputs(outputs), blocks((outputs + OUTS - 1) / OUTS) {
        if (bias) std::copy_n(bias, outputs, biases.begin());
    }
    void set(int o, int k, float value) { weights[((size_t)(o / OUTS) * terms + k) * OUTS + o % OUTS] = value; }
    // Terms from `at` on read the inputs of a kernel, tap by tap within each input.
    void set(int at, const float *from, int inputs, int taps) {
        for (int o = 0; o < outputs; o++)
            for (int k = 0; k < inputs * taps; k++) set(o, at + k, from[(size_t)o * inputs * taps + k]);
    }
    // Calls out(o, x, vec) for positions 0 .. n - 1 and those that fill the last vector; used(x, end) says
    // how many of the terms are not 0 there.
    template <class Used, class Out> void operator()(const float *const *in, int n, Used used, Out out) const {
        int x = 0;
        for (; x + WIDE * LANES <= n; x += WIDE * LANES) block<WIDE>(in, used(x, x + WIDE * LANES), x, out);
        for (; x < n; x += LANES) block<1>(in, used(x, x + LANES), x, out);
    }
    template <class Out> void operator()(const float *const *in, int n, Out out) const {
        (*this)(in, n, [this](int, int) { return terms; }, out);
    }
};

// Appends the terms that read rows y - up .. y + down of channels from .. to - 1, `reach` positions to
// either side; sign -1 turns the filter around, as a transpose needs.
static inline void square_terms(std::vector<const float *> &in, const Rows<float> &rows, int from, int to, int y,
                                int reach, int sign = 1) {
    for (int c = from; c < to; c++)
        for (int dy = -reach; dy <= reach; dy++) {
            const float *row = rows(y + sign * dy, c);
            for (int dx = -reach; dx <= reach; dx++) in.push_back(row + sign * dx);
        }
}

}  // namespace PXI_LEVEL
