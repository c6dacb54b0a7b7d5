// Colours that go into a layer's sheet, `premultiplied` of render/compose.py, and output samples,
// `_finished` of render/pixels.py; numpy is their judge.
#pragma once

#include <algorithm>
#include <cstdint>

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

// Rounds n premultiplied samples [n][channels] to 0..most, `out` [n][3], or [n][4] with straight alpha.
template <class Number>
void finished(const float *samples, int channels, int64_t n, int components, float most, Number *out) {
    for (int64_t k = 0; k < n; k++, samples += channels, out += components) {
        const float alpha = components == 4 ? std::max(samples[3], 1e-6f) : 1;
        for (int c = 0; c < components; c++) {
            const float v = c < 3 && components == 4 ? samples[c] / alpha : samples[c];
            // Adding 3 * 2^22 rounds to a whole number, halves to even.
            const float whole = std::clamp(v, 0.f, 1.f) * most + 12582912.f;
            out[c] = (Number)(int32_t)(whole - 12582912.f);
        }
    }
}

}  // namespace PXI_LEVEL
