// Colours that go into a layer's sheet, `premultiplied` of render/compose.py, and output samples,
// `_finished` of render/pixels.py; numpy is their judge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

// Clamps n outputs [n][channels], of 3 or 4 channels, to valid colours and alphas [n][4]; a NaN counts as 0.
inline void premultiplied(const float *output, int channels, int64_t n, float *to) {
    const auto within = [](float v, float most) {
        v = v > 0 ? v : 0;
        return v < most ? v : most;
    };
    for (int64_t k = 0; k < n; k++, output += channels, to += 4) {
        const float alpha = channels == 4 ? within(output[3], 1) : 1;
        for (int c = 0; c < 3; c++) to[c] = within(output[c], alpha);
        to[3] = alpha;
    }
}

struct Still {  // points of a rectangle that lie on samples of a raster
    const float *samples;          // [..][stride][channels]
    const int64_t *rows, *columns;  // of the raster, of each row and column of points
    const int64_t *at;             // [n] numbers of points that are painted, less `start`, ascending
    float *colour;                 // [..][4] of points, by these numbers
    uint8_t *known;                // [..] set to 1
    int64_t stride, width, start, n;  // width: points of a row
    int32_t channels;              // 1 or 3
};

// Puts colours of points, clamped as in `premultiplied`.
inline void painted(const Still &s) {
    const float *line = nullptr;
    const int64_t second = s.channels == 3;
    for (int64_t k = 0, first = 0, end = -1; k < s.n; k++) {
        const int64_t point = s.at[k] + s.start;
        if (point >= end) {
            const int64_t row = point / s.width;
            first = row * s.width, end = first + s.width;
            line = s.samples + s.rows[row] * s.stride * s.channels;
        }
        const float *from = line + s.columns[point - first] * s.channels;
        const float colour[3] = {from[0], from[second], from[2 * second]};
        premultiplied(colour, 3, 1, s.colour + 4 * s.at[k]);
        s.known[s.at[k]] = 1;
    }
}

struct Together {  // layers that show the same samples at points of a rectangle
    const float *samples;            // [..][stride][channels] of a raster
    const int64_t *rows, *columns;   // of the raster, of each row and column of points
    const int32_t *const *covers;    // [layers][height][width] 0..full, front to back; or null where all is covered
    float *out;                      // [height][width][4]
    int64_t stride, height, width;
    int32_t channels, layers, full;  // channels: 1 or 3
};

// Composites layers that show the same samples, clamped as in `premultiplied`, and summed as in `blend`.
inline void together(const Together &s) {
    const int64_t w = s.width, second = s.channels == 3;
    std::vector<float> clear(w), colour[4], sum[4];
    for (int c = 0; c < 4; c++) colour[c].assign(w, 1), sum[c].resize(w);
    for (int64_t y = 0; y < s.height; y++) {
        const float *line = s.samples + s.rows[y] * s.stride * s.channels;
        for (int64_t x = 0; x < w; x++)
            for (int c = 0; c < 3; c++) {
                const float v = line[s.columns[x] * s.channels + c * second];
                colour[c][x] = v > 0 ? v < 1 ? v : 1 : 0;
            }
        std::fill(clear.begin(), clear.end(), 1.f);
        for (std::vector<float> &to : sum) std::fill(to.begin(), to.end(), 0.f);
        for (int layer = 0; layer < s.layers; layer++) {
            const int32_t *cover = s.covers[layer] ? s.covers[layer] + y * w : nullptr;
            if (cover && !std::any_of(cover, cover + w, [](int32_t v) { return v; })) continue;
            const float unit = 1.f / (float)s.full;
            for (int c = 0; c < 4; c++) {
                float *to = sum[c].data();
                const float *from = colour[c].data(), *left = clear.data();
                if (cover)
                    for (int64_t x = 0; x < w; x++) to[x] += left[x] * ((float)cover[x] * unit) * from[x];
                else
                    for (int64_t x = 0; x < w; x++) to[x] += left[x] * from[x];
            }
            for (int64_t x = 0; x < w; x++) clear[x] *= cover ? 1 - (float)cover[x] * unit : 0;
        }
        float *to = s.out + 4 * y * w;
        for (int64_t x = 0; x < w; x++)
            for (int c = 0; c < 4; c++) *to++ = sum[c][x];
    }
}

// A sample rounded to 0..most.
template <class Number> inline Number rounded(float v, float most) {
    // Adding 3 * 2^22 rounds to a whole number, halves to even.
    const float whole = std::clamp(v, 0.f, 1.f) * most + 12582912.f;
    return (Number)(int32_t)(whole - 12582912.f);
}

// Rounds n premultiplied samples [n][channels] to 0..most, `out` [n][3], or [n][4] with straight alpha.
template <class Number>
void finished(const float *samples, int channels, int64_t n, int components, float most, Number *out) {
    if (components == 4) {
        for (int64_t k = 0; k < n; k++, samples += channels, out += 4) {
            const float alpha = std::max(samples[3], 1e-6f);
            for (int c = 0; c < 4; c++) out[c] = rounded<Number>(c < 3 ? samples[c] / alpha : samples[c], most);
        }
        return;
    }
    Number some[1024];  // all channels of some of the samples, which vectors round
    for (int64_t k = 0; k < n;) {
        const int count = (int)std::min<int64_t>(n - k, 1024 / channels);
        for (int i = 0; i < count * channels; i++) some[i] = rounded<Number>(samples[k * channels + i], most);
        for (int i = 0; i < count; i++, k++, out += 3)
            for (int c = 0; c < 3; c++) out[c] = some[i * channels + c];
    }
}

}  // namespace PXI_LEVEL
