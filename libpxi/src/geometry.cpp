#include "geometry.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "coded.h"
#include "core.h"

namespace pxi {

namespace {

constexpr int64_t COORDINATE_MAX = 1 << 26, SCALED_MAX = 1 << 30;

// One axis of GEO-7, with the fraction cancelled down, so that 64 bits are enough (GEO-16).
struct Axis {
    int64_t start, times, over;
    Axis(int origin, int size, int64_t samples, int unit) : start((int64_t)origin << unit) {
        const int64_t extent = (int64_t)size << unit, common = std::gcd(256 * samples, extent);
        times = 256 * samples / common, over = extent / common;
    }
    int64_t operator()(int64_t p) const {
        const __int128 twice = (__int128)2 * (p - start) * times + over;
        const __int128 found = floored<__int128>(twice, 2 * over);
        return (int64_t)std::clamp<__int128>(found, -SCALED_MAX, SCALED_MAX);
    }
};

// Binary logarithm of the number of chords of a segment of four points (GEO-8).
int chords_log2(const int64_t *p) {
    int64_t bend = 0;
    for (int c = 0; c < 4; c++) bend = std::max(bend, std::abs(p[c] - 2 * p[c + 2] + p[c + 4]));
    int log2 = 0;
    while (log2 < 8 && 3 * bend > (int64_t)64 << (2 * log2)) log2++;
    return log2;
}

}  // namespace

Boundary decode_boundary(const Layr &layr) {
    Boundary found;
    if (layr.segments.empty()) return found;
    const int64_t total = std::accumulate(layr.segments.begin(), layr.segments.end(), (int64_t)0);
    const std::vector<int32_t> rows = decode_signed(layr.classes, layr.deltas, 6, 1, (int)total, layr.at);
    int64_t origin[2] = {0, 0}, s = 0;
    for (const int count : layr.segments) {
        Path path;
        path.reserve((size_t)6 * count);
        int64_t at[2] = {origin[0], origin[1]};
        for (int k = 0; k < count; k++, s++)
            for (int row = 0; row < 6; row++) {
                int64_t &v = at[row & 1];
                v += rows[row * total + s];
                need(std::abs(v) < COORDINATE_MAX, "GEO-6", "a control point is out of range", layr.at);
                path.push_back(v);
            }
        origin[0] = path[0], origin[1] = path[1];
        found.push_back(std::move(path));
    }
    return found;
}

Boundary scaled(const Boundary &boundary, int unit, const std::array<int, 4> &region, int64_t columns, int64_t rows) {
    const Axis axes[2] = {{region[0], region[2], columns, unit}, {region[1], region[3], rows, unit}};
    Boundary out = boundary;
    for (Path &path : out)
        for (size_t i = 0; i < path.size(); i++) path[i] = axes[i & 1](path[i]);
    return out;
}

std::vector<int32_t> coverage(const Boundary &scaled, const Box &box, Budget &budget) {
    std::vector<int64_t> segments, log2;  // those that are not above, below or right of the rectangle
    int64_t chords = 0;
    for (const Path &path : scaled)
        for (size_t k = 0; k < path.size(); k += 6) {
            int64_t p[8], low = INT64_MAX, high = INT64_MIN, left = INT64_MAX;
            for (int i = 0; i < 8; i += 2) {
                const size_t at = (k + i) % path.size();
                left = std::min(left, p[i] = path[at] - (int64_t)256 * box.x);
                p[i + 1] = path[at + 1] - (int64_t)256 * box.y;
                low = std::min(low, p[i + 1]), high = std::max(high, p[i + 1]);
            }
            if (high <= 0 || low >= (int64_t)256 * box.height || left >= (int64_t)256 * box.width) continue;
            segments.insert(segments.end(), p, p + 8);
            log2.push_back(chords_log2(p));
            chords += (int64_t)1 << log2.back();
        }
    budget.spend(WORK, chords);
    std::vector<int64_t> cells((size_t)box.height * (box.width + 2));
    std::vector<int32_t> out((size_t)box.size());
    loops::Cover cover = {box.width, box.height, 0, budget.left(WORK), cells.data(), out.data()};
    core().coverage(&cover, segments.data(), log2.data(), (int64_t)log2.size());
    budget.spend(WORK, cover.work);
    return out;
}

}  // namespace pxi
