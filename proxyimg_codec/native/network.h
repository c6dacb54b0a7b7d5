// The network of an implicit texture: gather -> encode -> MLP; numpy, texture/network.py, is its judge,
// within rounding.
//
// Data is processed in blocks of BLOCK entries in structure-of-arrays layout [feature][entry], so that
// every inner loop runs along entries with full vectors. An *entry* is one layer's contribution to one
// pixel: four bilinear taps into the table of codes.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "vectors.h"

static const int BLOCK = 256, NV = BLOCK / LANES, MAX_LAYERS = 10;
static const float PI = 3.14159265358979f;

struct Net {  // shape of the decoder network; weights are [out][in] rows, then the biases, per layer
    int32_t dim, octaves, hidden, depth, channels;
};
struct Entries {  // taps of every entry: rows base, base+1, base+stride, base+stride+1 of the codes
    const int32_t *base, *stride;
    const float *fx, *fy;
};

namespace {

struct Layout {
    int in[MAX_LAYERS], out[MAX_LAYERS], weight[MAX_LAYERS], bias[MAX_LAYERS], row[MAX_LAYERS];
    int layers, encoded, total;
    explicit Layout(const Net &n) {
        layers = n.depth + 1;
        encoded = n.dim * (2 * n.octaves + 1);
        int offset = 0, rows = 0;
        for (int l = 0; l < layers; l++) {
            in[l] = l ? n.hidden : encoded;
            out[l] = l == n.depth ? n.channels : n.hidden;
            weight[l] = offset, bias[l] = offset + in[l] * out[l], row[l] = rows;
            offset = bias[l] + out[l], rows += out[l];
        }
        total = offset;
    }
};

struct Buffer {  // 64-byte aligned floats
    std::vector<float> store;
    float *p;
    explicit Buffer(size_t n) : store(n + 16) {
        p = (float *)(((uintptr_t)store.data() + 63) & ~(uintptr_t)63);
    }
    Buffer(const Buffer &) = delete;
};

// out[j] = bias[j] + sum_i w[j * ws + i * wi] * in[i], with `relu` negative ones replaced by 0.
// Takes R rows by two vectors at a time, and what rows are left R / 2 at a time.
template <int R = TILE>
void matmul(const float *w, int ws, int wi, const float *bias, bool relu, const vec *in, vec *out, int ni,
            int no) {
    for (; no >= R; no -= R, w += R * ws, bias += bias ? R : 0, out += R * NV)
        for (int c = 0; c < NV; c += 2) {
            vec a[R][2];
            // Without the pragmas gcc keeps the sums in memory.
#pragma GCC unroll 8
            for (int r = 0; r < R; r++) a[r][0] = a[r][1] = (vec){} + (bias ? bias[r] : 0.f);
            for (int i = 0; i < ni; i++) {
                const vec x = in[i * NV + c], y = in[i * NV + c + 1];
#pragma GCC unroll 8
                for (int r = 0; r < R; r++) {
                    const float s = w[r * ws + i * wi];
                    a[r][0] += s * x, a[r][1] += s * y;
                }
            }
#pragma GCC unroll 8
            for (int r = 0; r < R; r++)
                for (int k = 0; k < 2; k++)
                    out[r * NV + c + k] = relu ? (a[r][k] < 0 ? (vec){} : a[r][k]) : a[r][k];
        }
    if constexpr (R > 1)
        if (no) matmul<R / 2>(w, ws, wi, bias, relu, in, out, ni, no);
}

// sin(pi x) and cos(pi x): reduced to |r| <= 1/2, Taylor polynomials (error < 1e-7).
inline void sincospi(vec x, vec &s, vec &c) {
    // The largest number below 1/2, since adding 1/2 itself would round large odd numbers up.
    const vec half = (vec){} + .49999997f;
    const ints k = __builtin_convertvector(x + (x < 0 ? -half : half), ints);
    const vec r = (x - __builtin_convertvector(k, vec)) * PI, r2 = r * r;
    const vec sign = 1 - 2 * __builtin_convertvector(k & 1, vec);
    s = sign * r * (1 + r2 * (-1.f / 6 + r2 * (1.f / 120 + r2 * (-1.f / 5040 +
        r2 * (1.f / 362880 - r2 * (1.f / 39916800))))));
    c = sign * (1 + r2 * (-.5f + r2 * (1.f / 24 + r2 * (-1.f / 720 + r2 * (1.f / 40320 +
        r2 * (-1.f / 3628800 + r2 * (1.f / 479001600)))))));
}

struct Block {  // the working memory of one thread
    const Net net;
    const Layout lay;
    Buffer feature, encoded, acts;
    explicit Block(const Net &n)
        : net(n), lay(n), feature(n.dim * BLOCK), encoded(lay.encoded * BLOCK),
          acts((size_t)lay.layers * width() * BLOCK) {}
    int width() const { return std::max(net.hidden, net.channels); }
    float *act(int l) { return acts.p + (size_t)l * width() * BLOCK; }
    float *output() { return act(lay.layers - 1); }

    // Features of n entries: from `start` on, or those that `index` lists. What is left of the block
    // repeats the first one.
    void gather(const float *codes, const Entries &e, int64_t start, int n, const int32_t *index) {
        const int D = net.dim;
        for (int d = 0; d < D; d += 8)
            for (int p = 0; p < BLOCK; p++) {
                int64_t k = p < n ? (index ? index[p] : start + p) : (index ? index[0] : start);
                const float *a = codes + (int64_t)e.base[k] * D + d, *b = a + (int64_t)e.stride[k] * D;
                float x = e.fx[k], y = e.fy[k], w11 = x * y, w10 = x - w11, w01 = y - w11, w00 = 1 - x - w01;
                float *to = feature.p + d * BLOCK + p;
                if (d + 8 <= D) {
                    const vec8 f = w00 * *(vec8 *)a + w10 * *(vec8 *)(a + D) + w01 * *(vec8 *)b +
                                   w11 * *(vec8 *)(b + D);
                    for (int i = 0; i < 8; i++) to[i * BLOCK] = f[i];
                } else {
                    for (int i = 0; i < D - d; i++)
                        to[i * BLOCK] = w00 * a[i] + w10 * a[D + i] + w01 * b[i] + w11 * b[D + i];
                }
            }
    }

    // Feature by feature, which keeps few streams to memory at a time: those of the octaves lie
    // a power of two apart and would push each other out of the cache.
    void encode() {
        const int n = net.dim * NV;
        for (int d = 0; d < n; d += NV) {
            vec *to = (vec *)encoded.p + d, *s = to + n, *c = s + n;
            std::memcpy(to, (vec *)feature.p + d, NV * sizeof(vec));
            if (net.octaves)
                for (int v = 0; v < NV; v++) sincospi(to[v], s[v], c[v]);
            for (int k = 1; k < net.octaves; k++, s += 2 * n, c += 2 * n)
                for (int v = 0; v < NV; v++) {
                    const vec twice = 2 * s[v];
                    s[2 * n + v] = twice * c[v];
                    c[2 * n + v] = 1 - twice * s[v];
                }
        }
    }

    void forward(const float *weights) {
        encode();
        const float *in = encoded.p;
        for (int l = 0; l < lay.layers; l++) {
            float *out = act(l);
            matmul(weights + lay.weight[l], lay.in[l], 1, weights + lay.bias[l], l + 1 < lay.layers,
                   (const vec *)in, (vec *)out, lay.in[l], lay.out[l]);
            in = out;
        }
    }
};

}  // namespace
