// Coverage of output pixels by closed paths, geometry/coverage.py; numpy is its judge, bit for bit.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

struct Cover {                  // what chords leave in a rectangle of pixels
    int64_t width, height;
    int64_t work, most;         // pieces of chords so far, and how many there may be
    int64_t *cells;             // [height][width + 2], 0 at first: column 0 is all that lies left
    int32_t *out;               // [height][width]
};

static const int64_t COVER_ONE = 256, COVER_FULL = 2 * COVER_ONE * COVER_ONE;

inline int64_t floored(int64_t a, int64_t b) {  // a / b rounded down, b > 0
    const int64_t q = a / b;
    return q - (a % b < 0);
}

// A piece of a chord inside one row, from x_in to x_out, that climbs by dy.
inline void accumulate(Cover &to, int64_t *cells, int64_t x_in, int64_t x_out, int64_t dy) {
    const int64_t left = std::min(x_in, x_out), right = std::max(x_in, x_out), rise = std::abs(dy);
    const int64_t span = std::max<int64_t>(right - left, 1), sign = dy < 0 ? -1 : 1;
    const auto climbed = [&](int64_t x) {
        return x >= right ? rise : x <= left ? 0 : (x - left) * rise / span;
    };
    const int64_t first = std::max<int64_t>(left >> 8, 0), last = std::min(right >> 8, to.width - 1);
    int64_t before = first * COVER_ONE <= left ? 0 : climbed(first * COVER_ONE);
    if (left < 0) cells[0] += sign * climbed(0) * 2 * COVER_ONE;
    for (int64_t column = first; column <= last; column++) {
        const int64_t low = column * COVER_ONE, high = low + COVER_ONE, up = climbed(high);
        const int64_t part = sign * (up - before);
        const int64_t twice_mean = std::max(left, low) + std::min(right, high) - 2 * low;
        cells[column + 1] += part * (2 * COVER_ONE - twice_mean);
        cells[column + 2] += part * twice_mean;
        before = up;
    }
}

// A chord from a to b; false if there are too many pieces.
inline bool chord(Cover &to, std::vector<char> &touched, const int64_t *a, const int64_t *b) {
    to.work += std::min((std::abs(b[1] - a[1]) >> 8) + 2, to.height + 1);
    if (to.work > to.most) return false;
    if (a[1] == b[1]) return true;
    const int64_t sign = a[1] < b[1] ? 1 : -1;
    if (sign < 0) std::swap(a, b);
    const int64_t first = std::max<int64_t>(a[1] >> 8, 0);
    const int64_t last = std::min((b[1] - 1) >> 8, to.height - 1), wide = b[0] - a[0], high = b[1] - a[1];
    for (int64_t row = first; row <= last; row++) {
        const int64_t y_in = std::max(a[1], row * COVER_ONE), y_out = std::min(b[1], (row + 1) * COVER_ONE);
        const int64_t x_in = a[0] + floored((y_in - a[1]) * wide, high);
        const int64_t x_out = a[0] + floored((y_out - a[1]) * wide, high);
        to.work += std::min((std::abs(x_out - x_in) >> 8) + 2, to.width + 1);
        touched[row] = 1;
        accumulate(to, to.cells + row * (to.width + 2), x_in, x_out, (y_out - y_in) * sign);
    }
    return to.work <= to.most;
}

// Segments are [n][4][2], each of 2**log2[i] chords. Returns false if there are too many pieces.
inline bool coverage(Cover &to, const int64_t *segments, const int64_t *log2, int64_t n) {
    std::vector<char> touched(to.height);
    for (int64_t i = 0; i < n; i++, segments += 8) {
        const int64_t count = (int64_t)1 << log2[i], shift = 3 * log2[i];
        int64_t start[2] = {segments[0], segments[1]}, end[2];
        for (int64_t k = 1; k <= count; k++, start[0] = end[0], start[1] = end[1]) {
            const int64_t j = count - k;
            const int64_t w[4] = {j * j * j, 3 * j * j * k, 3 * j * k * k, k * k * k};
            for (int c = 0; c < 2; c++) {
                const int64_t sum = w[0] * segments[c] + w[1] * segments[2 + c] + w[2] * segments[4 + c] +
                                    w[3] * segments[6 + c];
                end[c] = sum >> shift;
            }
            if (!chord(to, touched, start, end)) return false;
        }
    }
    for (int64_t row = 0; row < to.height; row++) {
        if (!touched[row]) continue;
        const int64_t *cells = to.cells + row * (to.width + 2);
        int32_t *out = to.out + row * to.width;
        int64_t sum = cells[0];
        for (int64_t x = 0; x < to.width; x++) {
            sum += cells[x + 1];
            out[x] = (int32_t)std::min(std::abs(sum), COVER_FULL);
        }
    }
    return true;
}

}  // namespace PXI_LEVEL
