// Fill of unknown values by diffusion, texture/diffusion.py; numpy is its judge, bit for bit.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

static const int SWEEPS = 8, SWEPT = 128;  // sweeps at each level; side of the tiles that are swept

template <class N> N floor_divided(N a, N b) {  // a / b rounded down, b > 0
    return a / b - (a % b < 0);
}

struct Plane {                // of several channels, row by row
    int channels, height, width;
    int32_t *values;          // [channels][height][width]
    const uint8_t *known;     // [height][width]
    int64_t size() const { return (int64_t)height * width; }
};

// Fills the unknown values of a plane in place, at least in the tiles that are not all `done`.
class Diffusion {
    std::vector<int32_t> now, next, mask;  // mask: -1 where known

    static void swept(const int32_t *__restrict from, const int32_t *__restrict known, int32_t *__restrict to,
                      int pitch) {
        for (int x = 1; x < pitch - 1; x++) {
            const int32_t mean = (from[x - pitch] + from[x + pitch] + from[x - 1] + from[x + 1] + 2) >> 2;
            to[x] = mean ^ ((mean ^ from[x]) & known[x]);
        }
    }

    // Sweeps a tile of a channel, with a rim around it, from where influences cannot come farther.
    // Unknown values begin as those of their parents.
    void sweep(const Plane &p, int32_t *values, const int32_t *parents, int top, int left) {
        const int y0 = std::max(top - SWEEPS, 0), x0 = std::max(left - SWEEPS, 0);
        const int rows = std::min(top + SWEPT + SWEEPS, p.height) - y0;
        const int columns = std::min(left + SWEPT + SWEEPS, p.width) - x0, pitch = columns + 2;
        const auto edges = [&](std::vector<int32_t> &v) {  // are repeated
            for (int y = 1; y <= rows; y++) {
                int32_t *row = v.data() + y * pitch;
                row[0] = row[1], row[pitch - 1] = row[pitch - 2];
            }
            std::copy_n(v.data() + pitch, pitch, v.data());
            std::copy_n(v.data() + rows * pitch, pitch, v.data() + (rows + 1) * pitch);
        };
        for (auto *v : {&now, &next, &mask}) v->resize((rows + 2) * pitch);
        for (int y = 0; y < rows; y++) {
            const int64_t row = (int64_t)(y0 + y) * p.width + x0;
            const int32_t *parent = parents + (int64_t)((y0 + y) / 2) * ((p.width + 1) / 2);
            int32_t *to = now.data() + (y + 1) * pitch + 1, *known = mask.data() + (y + 1) * pitch + 1;
            for (int x = 0; x < columns; x++) {
                to[x] = p.known[row + x] ? values[row + x] : parent[(x0 + x) / 2];
                known[x] = -p.known[row + x];
            }
        }
        for (int turn = 0; turn < SWEEPS; turn++) {
            edges(now);
            for (int at = pitch; at <= rows * pitch; at += pitch)
                swept(now.data() + at, mask.data() + at, next.data() + at, pitch);
            now.swap(next);
        }
        for (int y = top; y < std::min(top + SWEPT, p.height); y++)
            std::copy_n(now.data() + (y - y0 + 1) * pitch + 1 + left - x0, std::min(SWEPT, p.width - left),
                        values + (int64_t)y * p.width + left);
    }

    static bool all(const uint8_t *done, const Plane &p, int top, int left) {
        const int columns = std::min(SWEPT, p.width - left);
        for (int y = top; y < std::min(top + SWEPT, p.height); y++)
            if (std::memchr(done + (int64_t)y * p.width + left, 0, columns)) return false;
        return true;
    }

  public:
    void run(const Plane &p, const uint8_t *done) {
        const int64_t size = p.size();
        if (size == 1 || !std::memchr(p.known, 0, size)) return;
        const int h = (p.height + 1) / 2, w = (p.width + 1) / 2;
        std::vector<int32_t> coarse((size_t)p.channels * h * w);
        std::vector<uint8_t> seen((size_t)h * w);
        for (int y = 0; y < h; y++)
            for (int x = 0; x < w; x++) {
                const int right = 2 * x + 1 < p.width, below = 2 * y + 1 < p.height;
                const int64_t at = 2 * ((int64_t)y * p.width + x), to = (int64_t)y * w + x;
                const int64_t under = below * p.width;
                const uint8_t *k = p.known + at;
                const int a = k[0], b = right & k[right], c = below & k[under];
                const int d = right & below & k[under + right];
                const int count = seen[to] = (uint8_t)(a + b + c + d);
                if (!count) continue;
                for (int channel = 0; channel < p.channels; channel++) {
                    const int32_t *v = p.values + channel * size + at;
                    const int32_t total = a * v[0] + b * v[right] + c * v[under] + d * v[under + right];
                    coarse[(int64_t)channel * h * w + to] =
                        count == 4 ? (total + 2) >> 2 : floor_divided(2 * total + count, 2 * count);
                }
            }
        for (uint8_t &n : seen) n = n > 0;
        run({p.channels, h, w, coarse.data(), seen.data()}, seen.data());
        for (int y = 0; y < p.height; y += SWEPT)
            for (int x = 0; x < p.width; x += SWEPT)
                if (!all(done, p, y, x))
                    for (int c = 0; c < p.channels; c++)
                        sweep(p, p.values + c * size, coarse.data() + (int64_t)c * h * w, y, x);
    }
};

}  // namespace PXI_LEVEL
