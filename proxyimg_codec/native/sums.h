// Sums over terms at many positions of a row: what convolutions of planes are made of. Vectors run along
// positions, so that no output is wasted.
#pragma once

#include <cstdint>

#include "level.h"
#include "vectors.h"

namespace PXI_LEVEL {

typedef float near_vec __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
static inline vec load(const float *p) { return *(const near_vec *)p; }
static inline void store(float *p, vec v) { *(near_vec *)p = v; }
static inline vec all(float f) { return f - (vec){}; }  // adding 0 would turn -0 to 0

struct Term {
    const float *from;     // a number for each position
    const float *weights;  // in each output
};

// out[o][j] = bias[o] + sum over terms k of weight o times the numbers from x + j * LANES on, for OUTS outputs
// and V vectors; term(k) is a Term. Not a part of what calls it, where one of the sums would find no register.
template <int OUTS, int V, class Of>
__attribute__((noinline)) static void add_terms(Of term, int count, int x, const float *bias, vec *out) {
    vec sums[OUTS][V];
#pragma GCC unroll 8
    for (int o = 0; o < OUTS; o++)
        for (int j = 0; j < V; j++) sums[o][j] = all(bias[o]);
    for (int k = 0; k < count; k++) {
        const Term t = term(k);
        vec v[V];
#pragma GCC unroll 4
        for (int j = 0; j < V; j++) v[j] = load(t.from + x + j * LANES);
#pragma GCC unroll 8
        for (int o = 0; o < OUTS; o++) {
            const vec weight = all(t.weights[o]);
#pragma GCC unroll 4
            for (int j = 0; j < V; j++) sums[o][j] += v[j] * weight;
        }
    }
#pragma GCC unroll 8
    for (int o = 0; o < OUTS; o++)
        for (int j = 0; j < V; j++) out[o * V + j] = sums[o][j];
}

}  // namespace PXI_LEVEL
