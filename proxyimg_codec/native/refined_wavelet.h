// The plain wavelet in floating point, as an input of the context network, and its transpose; the judge is
// `plain_synthesis` of encoder/pyramid/model.py.
#pragma once

#include "refined_level.h"

namespace PXI_LEVEL {

// Synthesis filters along an axis: [low, high][even, odd][tap].
struct Axis {
    float taps[2][2][5];
};

class PlainWavelet {
    RefinedLevel &s;      // whose latents and planes make the planes of the next finer level
    Floats &finer;
    const Axis &axis;
    const int c, w;       // colour
    std::vector<float> memory;
    float *sides[2];      // a row of what is low across, and of what is high

    // Calls f(side, weight, row of low planes or null, band) for all that makes a row of the finer planes.
    template <class F> void vertically(int row, F f) {
        for (int side = 0; side < 2; side++)
            for (int down = 0; down < 2; down++)
                for (int tap = 0; tap < 5; tap++) {
                    const float weight = axis.taps[down][row % 2][tap];
                    const int y = mirrored(row / 2 - 2 + tap, s.rows, down), band = side ? 2 * down : 1;
                    if (weight != 0) f(side, weight, y, side || down ? 3 * c + band : -1);
                }
    }
    // Calls f(finer position, side, position, weight) for all that makes a row of the finer planes.
    template <class F> void across(F f) {
        for (int side = 0; side < 2; side++)
            for (int odd = 0; odd < 2; odd++)
                for (int tap = 0; tap < 5; tap++)
                    if (const float weight = axis.taps[side][odd][tap]; weight != 0)
                        f(side, odd, tap, weight);
    }
    template <class F> void along(int side, int odd, int tap, F f) {
        const int n = (s.columns - odd + 1) / 2;
        for (int j = 0; j < n; j++) {
            const int i = j - 2 + tap;
            f(2 * j + odd, i >= 0 && i < w - 1 ? i : mirrored(i, s.columns, side));
        }
    }

  public:
    PlainWavelet(RefinedLevel &level, Floats &finer, const Axis &axis, int colour)
        : s(level), finer(finer), axis(axis), c(colour), w(level.w), memory(2 * (size_t)w),
          sides{memory.data(), memory.data() + w} {}

    void forward() {
        for (int row = 0; row < s.rows; row++) {
            std::fill(memory.begin(), memory.end(), 0.f);
            vertically(row, [&](int side, float weight, int y, int channel) {
                const float *from = channel < 0 ? s.plain(y, c) : s.latents(y, channel);
                float *to = sides[side];
                for (int x = 0; x < w; x++) to[x] += weight * from[x];
            });
            float *to = finer(row, c);
            std::fill_n(to, s.columns, 0.f);
            across([&](int side, int odd, int tap, float weight) {
                along(side, odd, tap, [&](int x, int i) { to[x] += weight * sides[side][i]; });
            });
        }
    }
    // Adds to the slopes of planes and latents, from those of the finer planes.
    void back(const Floats &by_finer) {
        for (int y = 0; y < s.h; y++) std::fill_n(s.by_plain(y, c), w, 0.f);
        for (int row = 0; row < s.rows; row++) {
            std::fill(memory.begin(), memory.end(), 0.f);
            const float *from = by_finer(row, c);
            across([&](int side, int odd, int tap, float weight) {
                along(side, odd, tap, [&](int x, int i) { sides[side][i] += weight * from[x]; });
            });
            vertically(row, [&](int side, float weight, int y, int channel) {
                float *to = channel < 0 ? s.by_plain(y, c) : s.by_latents(y, channel);
                for (int x = 0; x < w; x++) to[x] += weight * sides[side][x];
            });
        }
    }
};

}  // namespace PXI_LEVEL
