// The plain wavelet of the pyramid in integers, `next_plain` of texture/context.py; numpy is its judge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

struct Plain {                 // planes that low and high bands give
    const int32_t *low;        // [3][height][width]
    const int32_t *high;       // [9][height][width], channel 3 colour + band
    int32_t height, width, rows, columns;
    const int32_t *taps;       // [low, high][even, odd][5] in 1/256
    int32_t most;              // largest magnitude of a result
    int32_t *out;              // [3][rows][columns]
};

// Index into a band of a line of `size` samples, mirrored about the first and the last of them.
inline int mirrored(int i, int size, bool high) {
    const int count = (size + 1 - high) / 2;
    if (i < 0) i = -i - high;
    if (i >= count) i = size - 1 - high - i;
    return std::clamp(i, 0, std::max(count - 1, 0));
}

class Lifting {
    static constexpr int TAPS = 5;

    const Plain &s;
    const int w;
    std::vector<int32_t> sides[2], halves[2];  // rows of bands [w + 4], and of half of the samples [w]

    // Row y of what two bands give; high ones are in units of 16.
    void down(const int32_t *low, const int32_t *high, int low_shift, int y, int32_t *__restrict out) {
        int32_t weights[2 * TAPS];
        const int32_t *from[2 * TAPS];
        for (int kind = 0; kind < 2; kind++)
            for (int tap = 0; tap < TAPS; tap++) {
                const int k = TAPS * kind + tap;
                weights[k] = s.taps[2 * TAPS * kind + TAPS * (y % 2) + tap] * (1 << (kind ? 4 : low_shift));
                from[k] = (kind ? high : low) + (int64_t)mirrored(y / 2 - 2 + tap, s.rows, kind) * w;
            }
        for (int x = 0; x < w; x++) {
            int32_t total = 128;
            for (int k = 0; k < 2 * TAPS; k++) total += weights[k] * from[k][x];
            out[x] = total >> 8;
        }
    }

    void across(int32_t *__restrict out) {
        for (int kind = 0; kind < 2; kind++) {
            int32_t *row = sides[kind].data() + 2;
            const int32_t before[2] = {row[mirrored(-2, s.columns, kind)], row[mirrored(-1, s.columns, kind)]};
            int32_t after[3];
            for (int k = 0; k < 3; k++) after[k] = row[mirrored(w - 1 + k, s.columns, kind)];
            std::copy_n(before, 2, row - 2), std::copy_n(after, 3, row + w - 1);
        }
        const int32_t most = s.most;
        for (int phase = 0; phase < 2; phase++) {
            const int32_t *l = s.taps + TAPS * phase, *h = l + 2 * TAPS, *low = sides[0].data(), *high = sides[1].data();
            int32_t *__restrict to = halves[phase].data();
            for (int x = 0; x < w; x++) {
                int32_t total = 128;
                for (int tap = 0; tap < TAPS; tap++) total += l[tap] * low[x + tap] + h[tap] * high[x + tap];
                to[x] = std::clamp(total >> 8, -most, most);
            }
        }
        const int32_t *even = halves[0].data(), *odd = halves[1].data();
        for (int x = 0; x < s.columns / 2; x++) out[2 * x] = even[x], out[2 * x + 1] = odd[x];
        if (s.columns % 2) out[s.columns - 1] = even[s.columns / 2];
    }

  public:
    explicit Lifting(const Plain &plain) : s(plain), w(s.width) {
        for (int k = 0; k < 2; k++) sides[k].resize(w + 4), halves[k].resize(w);
    }
    void run() {
        const int64_t size = (int64_t)s.height * w;
        for (int c = 0; c < 3; c++) {
            const int32_t *band = s.high + 3 * c * size;
            for (int y = 0; y < s.rows; y++) {
                down(s.low + c * size, band + size, 0, y, sides[0].data() + 2);
                down(band, band + 2 * size, 4, y, sides[1].data() + 2);
                across(s.out + ((int64_t)c * s.rows + y) * s.columns);
            }
        }
    }
};

}  // namespace PXI_LEVEL
