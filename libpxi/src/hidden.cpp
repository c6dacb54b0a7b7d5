#include "hidden.h"

#include <algorithm>
#include <cmath>

#include "core.h"

namespace pxi {

static const int DRIFT = 3072;  // the largest correction of a copy (PYR-50)
static const int TELLING = 3;    // distance up to which samples tell the colour behind (PYR-52)

void even_out(Components &colours, size_t count) {
    while (colours.size() < count) colours.push_back(colours[0]);
}

static int32_t whole(float v) { return (int32_t)std::nearbyint(FILL_ONE * v); }

Components filled(const Texr &t, const Components &own, Mask known, const Behind *behind) {
    const int w = t.part[2], h = t.part[3], channels = (int)own.size();
    const int64_t size = (int64_t)w * h;
    std::vector<int32_t> values(size * channels);
    for (int64_t i = 0; i < size; i++) {
        const bool other = behind && !known[i] && behind->there[i];
        const Components &from = other ? behind->values : own;
        for (int c = 0; c < channels; c++) values[c * size + i] = whole(from[c][i]);
        if (other) known[i] = 1;
    }
    const loops::Plane plane = {channels, h, w, values.data(), known.data()};
    if (!t.copied.empty()) {
        const int side = 1 << t.grain;
        loops::Copies copies = {plane, known.data(), t.offsets.data(), t.copied.data(), (h + side - 1) / side,
                                (w + side - 1) / side, t.grain, DRIFT, FILL_ONE};
        check_core(core().completed(&copies), t.at);
    }
    check_core(core().diffused(&plane, known.data()), t.at);
    Components out(channels);
    for (int c = 0; c < channels; c++) {
        out[c].resize(size);
        for (int64_t i = 0; i < size; i++) out[c][i] = (float)values[c * size + i] / FILL_ONE;
    }
    return out;
}

// Calls each(number) for the samples of a part that are at most `reach` away from one.
template <class Each> static void around(int64_t i, int reach, int w, int h, Each each) {
    const Window near = Window{(int)(i / w), (int)(i / w) + 1, (int)(i % w), (int)(i % w) + 1}.grown(reach, {h, w});
    for (int y = near.top; y < near.bottom; y++)
        for (int x = near.left; x < near.right; x++) each((int64_t)y * w + x);
}

void unmix(const Edge &edge, const Components &mixed, Components &values, int w, int h) {
    std::vector<double> sums(values.size());
    const double *next = edge.share.data();
    for (int64_t i = 0; i < (int64_t)edge.core.size(); i++) {
        if (!edge.core[i]) continue;
        const double share = *next++;
        int count = 0;
        std::fill(sums.begin(), sums.end(), 0);
        around(i, TELLING, w, h, [&](int64_t j) {
            if (!edge.free[j]) return;
            count++;
            for (size_t c = 0; c < mixed.size(); c++) sums[c] += mixed[c][j];
        });
        for (size_t c = 0; count && c < mixed.size(); c++)
            values[c][i] = (float)std::clamp((mixed[c][i] - (1 - share) * sums[c] / count) / share, 0., 1.);
    }
    for (int64_t i = 0; i < (int64_t)edge.outer.size(); i++) {
        if (!edge.outer[i]) continue;
        int count = 0;
        std::fill(sums.begin(), sums.end(), 0);
        around(i, 1, w, h, [&](int64_t j) {
            if (!edge.core[j]) return;
            count++;
            for (size_t c = 0; c < values.size(); c++) sums[c] += values[c][j];
        });
        for (size_t c = 0; count && c < values.size(); c++) values[c][i] = (float)(sums[c] / count);
    }
}

}  // namespace pxi
