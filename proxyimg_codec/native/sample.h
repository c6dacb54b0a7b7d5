// Colours of a raster, texture/synthesis.py, its cubic interpolation, texture/pyramid.py, and compositing,
// render/compose.py; numpy is their judge, within rounding.
#pragma once

#include <algorithm>
#include <cstdint>

#include "level.h"

namespace PXI_LEVEL {

struct Points {               // of n points
    const int32_t *first;     // sample up and left of the four by four that count
    const float *fx, *fy;     // fractions
    int64_t n;
};

// Samples are [..][stride][C]; out is [n][C].
template <int C> void sample(const float *samples, int64_t stride, const Points &at, float *out) {
    const auto weights = [](float f, float *w) {
        w[0] = ((2 - f) * f - 1) * f * .5f;
        w[1] = ((3 * f - 5) * f * f + 2) * .5f;
        w[2] = ((4 - 3 * f) * f + 1) * f * .5f;
        w[3] = (f - 1) * f * f * .5f;
    };
    for (int64_t k = 0; k < at.n; k++, out += C) {
        float across[4], down[4], sum[C] = {};
        weights(at.fx[k], across);
        weights(at.fy[k], down);
        const float *row = samples + (int64_t)at.first[k] * C;
        for (int j = 0; j < 4; j++, row += stride * C) {
            float part[C] = {};
            for (int i = 0; i < 4; i++)
                for (int c = 0; c < C; c++) part[c] += across[i] * row[i * C + c];
            for (int c = 0; c < C; c++) sum[c] += down[j] * part[c];
        }
        std::copy_n(sum, C, out);
    }
}

// Samples [n][3] in 0..255 of planes [n][3]; `colours` is [3][3].
inline void coloured(const float *planes, const float *colours, int64_t n, float *out) {
    for (int64_t k = 0; k < 3 * n; k += 3)
        for (int c = 0; c < 3; c++) {
            const float *w = colours + 3 * c;
            out[k + c] = planes[k] * w[0] + planes[k + 1] * w[1] + planes[k + 2] * w[2] + 128;
        }
}

// Samples as `coloured`, in 0..1 and clamped.
inline void shown(const float *planes, const float *colours, int64_t n, float *out) {
    for (int64_t k = 0; k < 3 * n; k += 3) {
        coloured(planes + k, colours, 1, out + k);
        for (int c = 0; c < 3; c++) out[k + c] = std::clamp(out[k + c] / 255, 0.f, 1.f);
    }
}

// Puts n premultiplied colours [n][4], covered in part, behind what is there; coverage may be null.
inline void blend(float *result, float *clear, const float *colour, const float *coverage, int64_t n) {
    for (int64_t k = 0; k < n; k++, result += 4, colour += 4) {
        const float covered = coverage ? coverage[k] : 1, weight = clear[k] * covered;
        for (int c = 0; c < 4; c++) result[c] += weight * colour[c];
        clear[k] *= 1 - covered * colour[3];
    }
}

}  // namespace PXI_LEVEL
