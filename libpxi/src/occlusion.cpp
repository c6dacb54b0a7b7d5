#include "occlusion.h"

#include <algorithm>
#include <cmath>

#include "latents.h"

namespace pxi {

static const int BAND = 1 << 18;  // samples whose coverage is computed at a time
static const int REACH = 2;  // distance in samples up to which a boundary mixes colours

static int over(int n, int log2) { return (int)(((int64_t)n + (1 << log2) - 1) >> log2); }
static bool some(const Mask &mask) { return std::find(mask.begin(), mask.end(), 1) != mask.end(); }

Mask spread(const Mask &cells, int log2, int w, int h) {
    Mask out((int64_t)w * h);
    const int wide = over(w, log2);
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) out[(int64_t)y * w + x] = cells[(int64_t)(y >> log2) * wide + (x >> log2)];
    return out;
}

Mask stored_of(const Plan &p) {
    const Mask cells = support_of(p);
    return cells.empty() ? Mask((int64_t)p.width * p.height, 1) : spread(cells, p.cell, p.width, p.height);
}

// Adds what lies within a reach along lines of `count` samples, `step` apart.
static Mask along(const Mask &from, int count, int64_t step, int lines, int64_t stride, int reach) {
    Mask out(from.size());
    for (int line = 0; line < lines; line++)
        for (int i = 0; i < count; i++)
            if (from[line * stride + i * step])
                for (int k = std::max(i - reach, 0); k <= std::min(i + reach, count - 1); k++)
                    out[line * stride + k * step] = 1;
    return out;
}

// Samples that are not within a reach of a spoilt one, in both directions.
static Mask far(const Mask &spoilt, int w, int h, int reach = REACH) {
    if (!some(spoilt)) return Mask(spoilt.size(), 1);
    Mask out = along(along(spoilt, h, w, w, 1, reach), w, 1, h, w, reach);
    for (uint8_t &v : out) v = !v;
    return out;
}

template <class Test> static Mask where(size_t size, Test test) {
    Mask out(size);
    for (size_t i = 0; i < size; i++) out[i] = test(i);
    return out;
}

int Occlusion::body(int layer) const {
    if (!scene.moving) return -1;
    const Motn &m = file.motion;
    const auto found = std::find(m.layers.begin(), m.layers.end(), layer);
    return found == m.layers.end() ? -1 : m.bodies[found - m.layers.begin()];
}

bool Occlusion::rests(int other) const {
    const Texr &its = file.textures[file.source(other)];
    if (!scene.drawn[other] || its.coder != PYRAMID || its.planes != texr.planes) return false;
    const auto &mine = file.layers[k].box, &box = file.layers[other].box;
    for (int i = 0; i < 2; i++)
        if (mine[i] - texr.part[i] != box[i] - its.part[i] || box[i + 2] != its.part[i + 2]) return false;
    const Pose &a = file.pose(n), &b = file.pose(other);
    const auto plain = [](const Pose &p) {
        return p.node_classes.empty() && p.place_classes.empty() && p.opacity == 65535;
    };
    return plain(a) && plain(b) && a.matrix == b.matrix && a.shift == b.shift && a.colour == b.colour &&
           body(n) == body(other);
}

bool Occlusion::in_place() const {
    if (texr.coder != PYRAMID) return true;
    const bool own = !texr.cuts.empty() && texr.cuts[0] == k;
    for (const int cut : texr.cuts)
        if (cut != k && !rests(cut)) return false;
    for (int b = 0; own && b < k; b++)
        if (!rests(b)) return false;
    for (int b = 0; texr.matte && !texr.cuts.empty() && b < n; b++)
        if (scene.drawn[b] && !rests(b)) return false;
    return true;
}

Mask Occlusion::masked() const {
    return texr.cells.empty() ? Mask((int64_t)w * h, 1) : spread(texr.cells, texr.cell, w, h);
}

// Coverage of the part by the boundary that a layer has at rest; computed where there may be any, in
// bands, which bounds memory.
std::vector<int32_t> Occlusion::covered(int layer) const {
    if (boundaries[layer].empty()) return {};
    const auto &box = file.layers[k].box;
    const Boundary paths = scaled(boundaries[layer], file.layers[layer].unit, {0, 0, 1, 1}, 1, 1);
    int64_t low[2] = {INT64_MAX, INT64_MAX}, high[2] = {INT64_MIN, INT64_MIN};
    for (const Path &path : paths)
        for (size_t i = 0; i < path.size(); i++)
            low[i & 1] = std::min(low[i & 1], path[i]), high[i & 1] = std::max(high[i & 1], path[i]);
    const auto within = [&](int64_t v, int axis) {  // samples of the part
        return (int)std::clamp<int64_t>(v - box[axis], 0, axis ? h : w);
    };
    const Window some = {within(low[1] >> 8, 1), within((high[1] >> 8) + 1, 1), within(low[0] >> 8, 0),
                         within((high[0] >> 8) + 1, 0)};
    std::vector<int32_t> out((size_t)w * h);
    Budget budget(limits);
    const int step = std::max(BAND / std::max(some.columns(), 1), 1);
    for (int top = some.top; top < some.bottom && some.columns() > 0; top += step) {
        const int rows = std::min(step, some.bottom - top);
        const std::vector<int32_t> band =
            coverage(paths, {box[0] + some.left, box[1] + top, some.columns(), rows}, budget);
        const Shape shape = {rows, some.columns()};
        paste(band.data(), shape, Window::whole(shape), out.data(), {h, w},
              {top, top + rows, some.left, some.right}, 1);
    }
    return out;
}

// The samples that are bare to the layer itself (PYR-46, second case).
Mask Occlusion::bare_behind() const {
    const size_t size = (size_t)w * h;
    Mask found(size), hidden(size);
    bool all = true;
    for (int b = 0; b < k; b++) all &= rests(b);
    if (all) return found;
    for (int b = k - 1; b >= 0; b--) {
        const bool still = rests(b);
        if (still && file.textures[file.source(b)].matte) continue;
        const std::vector<int32_t> cover = covered(b);
        for (size_t i = 0; i < size; i++) {
            const int64_t value = cover.empty() ? FULL : cover[i];
            if (still && value == FULL) hidden[i] = 1;
            if (!still && value > 0 && !hidden[i]) found[i] = 1;
        }
    }
    return found;
}

// The samples at the boundary of the layer, whose coverage is `own`.
Edge Occlusion::edge_of(const std::vector<int32_t> &own, const Mask &open, const Mask &lost) const {
    const Mask away = far(where(own.size(), [&](size_t i) { return own[i] < FULL && lost[i]; }), w, h, 1);
    Edge edge;
    edge.core.resize(own.size()), edge.outer.resize(own.size());
    const auto at = [&](int x, int y) -> int64_t {
        return own[(int64_t)std::clamp(y, 0, h - 1) * w + std::clamp(x, 0, w - 1)];
    };
    for (int64_t i = 0; i < (int64_t)own.size(); i++) {
        if (!open[i] || away[i]) continue;
        if (2 * own[i] < FULL) {
            edge.outer[i] = 1;
            continue;
        }
        const int x = (int)(i % w), y = (int)(i / w);
        const auto row = [&](int y) { return at(x - 1, y) + 4 * at(x, y) + at(x + 1, y); };
        edge.core[i] = 1;
        edge.share.push_back(std::max((double)(row(y - 1) + 4 * row(y) + row(y + 1)) / (36. * FULL), 0.5));
    }
    return edge;
}

// Without what a matte does; `lost` are the samples that are bare to the layer itself, or none.
Masks Occlusion::hard(Mask *lost) const {
    Masks out;
    const Mask masked = this->masked();
    const size_t size = masked.size();
    if (texr.cuts.empty()) {
        if (!texr.cells.empty()) out.shown = out.trusted = masked;
        return out;
    }
    Mask fronts(size), bare(size), open = masked;
    for (const int cut : texr.cuts) {
        if (cut == k) continue;
        const std::vector<int32_t> cover = covered(cut);
        const bool still = rests(cut);
        for (size_t i = 0; i < size; i++) {
            if (!cover[i]) continue;
            fronts[i] = 1;
            if (cover[i] == FULL) open[i] = 0;
            if (!still) bare[i] = 1;
        }
    }
    const bool owned = texr.cuts[0] == k;
    const std::vector<int32_t> own = owned ? covered(k) : std::vector<int32_t>(size, FULL);
    out.shown = where(size, [&](size_t i) { return open[i] && own[i] > 0; });
    if (!some(out.shown)) out.shown = masked;
    const Mask apart = far(where(size, [&](size_t i) { return fronts[i] || own[i] < FULL; }), w, h);
    out.trusted = where(size, [&](size_t i) { return masked[i] && apart[i]; });
    if (!some(out.trusted)) out.trusted = out.shown;
    const Mask clear = far(bare, w, h);
    for (size_t i = 0; i < size; i++) open[i] &= clear[i];
    if (owned) *lost = bare_behind();
    if (!owned || !texr.unmix) {
        const Mask beside = owned ? far(where(size, [&](size_t i) { return own[i] < FULL && (*lost)[i]; }), w, h)
                                  : Mask(size, 1);
        const Mask left = where(size, [&](size_t i) { return open[i] && own[i] > 0 && beside[i]; });
        if (some(left)) out.shown = left;
        return out;
    }
    out.edge = edge_of(own, open, *lost);
    const Mask left = where(size, [&](size_t i) { return open[i] && own[i] > 0 && !out.edge.outer[i]; });
    if (!some(left)) return out;
    const Mask beyond = far(where(size, [&](size_t i) { return own[i] != 0; }), w, h, 1);
    out.edge.free = where(size, [&](size_t i) { return masked[i] && beyond[i] && !fronts[i]; });
    out.shown = left;
    out.unmixed = true;
    return out;
}

Masks Occlusion::masks() const {
    Mask lost;
    Masks out = hard(&lost);
    if (!texr.matte) return out;
    out.soft = stored_of(file.plans[texr.matte - 1]);
    const size_t size = out.soft.size();
    if (out.shown.empty()) out.shown = out.trusted = Mask(size, 1);
    bool apart = false;
    for (int b = 0; b < n; b++) apart |= scene.drawn[b] && !rests(b);
    const Mask still = !lost.empty() && !apart ? far(lost, w, h) : Mask(size);
    for (size_t i = 0; i < size; i++) {
        out.shown[i] &= !out.soft[i] || still[i];
        out.trusted[i] &= !out.soft[i];
    }
    return out;
}

}  // namespace pxi
