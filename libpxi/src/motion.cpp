#include "motion.h"

#include <algorithm>
#include <cstdlib>

#include "coded.h"

namespace pxi {

namespace {

constexpr int64_t CURVE_MAX = 1 << 15, SHAPE_MAX = 1 << 20, POINT_MAX = 1 << 30, ONE = 1024, SUM = (int64_t)6 << 30;

void in_range(bool ok, const Place &at) { need(ok, "MOT-5", "a curve or shape is out of range", at); }

}  // namespace

Motion::Motion(const Motn &m, const std::vector<Refined> &meshes, Budget &budget)
    : motn(m), span(m.loop ? m.intervals : m.intervals + 3) {
    for (const int layer : m.layers) nodes.push_back(meshes[layer].count()), total += nodes.back();
    const int64_t columns = (int64_t)m.layers.size() * span;
    budget.spend(MOTION, m.modes * (columns + 2 * (int64_t)total));
    budget.spend(WAVEFRONTS, columns + 2 + total + 2 * m.modes);
    curves = decode_signed(m.curve_classes, m.curve_deltas, m.modes, 1, (int)columns, m.at);
    for (size_t i = 0; i < curves.size(); i++) {
        const int64_t v = curves[i] + (i % span ? (int64_t)curves[i - 1] : 0);
        in_range(std::abs(v) < CURVE_MAX, m.at);
        curves[i] = (int32_t)v;
    }
    shapes = decode_signed(m.shape_classes, m.shape_deltas, 2, m.modes, total, m.at);
    size_t at = 0;
    for (int row = 0; row < 2 * m.modes; row++)
        for (size_t l = 0; l < nodes.size(); at += nodes[l], l++) predict(shapes.data() + at, meshes[m.layers[l]]);
    for (const int32_t v : shapes) in_range(std::abs((int64_t)v) < SHAPE_MAX, m.at);
}

std::vector<Points> Motion::at(int64_t microseconds, size_t layers) const {
    const int64_t end = (int64_t)1000 * motn.duration;
    const int64_t t = motn.loop ? microseconds - floored(microseconds, end) * end : std::clamp<int64_t>(microseconds, 0, end);
    int64_t interval = ONE * t * motn.intervals / end, f = interval % ONE;
    interval /= ONE;
    if (interval == motn.intervals) interval--, f = ONE;
    const int64_t g = ONE - f;
    const int64_t weights[4] = {g * g * g, 3 * f * f * f - 6144 * f * f + ((int64_t)1 << 32),
                                3 * g * g * g - 6144 * g * g + ((int64_t)1 << 32), f * f * f};
    std::vector<Points> out(layers);
    size_t first = 0;
    for (size_t l = 0; l < nodes.size(); first += nodes[l], l++) {
        std::vector<int64_t> values;
        for (int m = 0; m < motn.modes; m++) {
            const int32_t *curve = curves.data() + (m * nodes.size() + l) * span;
            int64_t sum = SUM / 2 / 256;
            for (int k = 0; k < 4; k++) sum += weights[k] * curve[(interval + k) % span];
            values.push_back(floored(sum, SUM / 256));
        }
        Points &moves = out[motn.layers[l]];
        moves.resize((size_t)2 * nodes[l]);
        for (size_t i = 0; i < moves.size(); i++) {
            const int32_t *shape = shapes.data() + (i & 1) * motn.modes * (size_t)total + first + i / 2;
            int64_t sum = (int64_t)1 << (5 + motn.unit);
            for (int m = 0; m < motn.modes; m++) sum += values[m] * shape[(size_t)m * total];
            moves[i] = std::clamp(sum >> (6 + motn.unit), -POINT_MAX, POINT_MAX);
        }
    }
    return out;
}

}  // namespace pxi
