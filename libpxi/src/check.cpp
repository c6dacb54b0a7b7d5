// Rules between chunks, and what they will cost to decode (SEC-2, SEC-5).
#include <algorithm>
#include <set>
#include <string_view>

#include "models.h"
#include "read.h"

namespace pxi {

static int64_t over(int64_t n, int log2) { return (n + ((int64_t)1 << log2) - 1) >> log2; }

static void check_counts(const File &f, Budget &budget) {
    const Head &h = f.head;
    budget.check(LAYERS, h.layers);
    budget.check(NETWORKS, h.networks);
    budget.check(SIDE, std::max(h.width, h.height));
    need(f.layers.size() == (size_t)h.layers, "CHK-4", "the number of LAYR is not that of HEAD");
    need(f.networks.size() == (size_t)h.networks, "CHK-4", "the number of NETW is not that of HEAD");
    need(f.textures.size() == (size_t)h.layers, "CHK-4", "the number of TEXR is not that of HEAD");
    need(h.depth == 8 || h.depth == 16, "CHK-2", "depth is neither 8 nor 16");
    std::set<std::string_view> names;
    for (const Layr &l : f.layers)
        need(names.insert(l.name).second, "CHK-5", "two layers have the same name", l.at);
    for (const Mesh &mesh : f.meshes)
        need(mesh.layer < h.layers, "CHK-9", "a mesh of a layer that does not exist", mesh.at);
    for (const Pose &pose : f.poses)
        need(pose.layer < h.layers, "CHK-10", "a pose of a layer that does not exist", pose.at);
}

static void check_layers(const File &f, Budget &budget) {
    for (int k = 0; k < f.head.layers; k++) {
        const Layr &l = f.layers[k];
        need(l.box[2] >= 1 && l.box[3] >= 1, "CHK-6", "the box is empty", l.at);
        supported(l.sampling <= 3, "CHK-7", "the sampling is not known", l.at);
        const bool nodes = l.sampling == 1 || l.sampling == 2;
        need(!nodes || of_layer(f.meshes, k), "CHK-7", "node sampling needs a mesh", l.at);
        const bool bare = !l.unit && l.classes.empty() && l.deltas.empty();
        need(!l.segments.empty() || bare, "CHK-8", "a layer without segments has a boundary", l.at);
        for (const int count : l.segments) budget.spend(SEGMENTS, count);
    }
    for (const Mesh &mesh : f.meshes) budget.spend(GATES, mesh.gates);
}

static void check_poses(const File &f) {
    for (const Pose &p : f.poses) {
        const auto &[a, b, c, d] = p.matrix;  // products of less than 2**62
        need(a * d != b * c, "POS-2", "the matrix is singular", p.at);
        need(p.colour.empty() || p.colour.size() == 12, "CHK-11", "a colour matrix has 12 items", p.at);
        const bool meshed = of_layer(f.meshes, p.layer);
        for (const auto &[classes, deltas] : {std::pair{p.node_classes, p.node_deltas},
                                              std::pair{p.place_classes, p.place_deltas}}) {
            need(!classes.empty() || deltas.empty(), "POS-1", "displacements have no classes", p.at);
            need(classes.empty() || meshed, "POS-1", "displacements need a mesh", p.at);
        }
        const bool moved = !p.identity() || !p.node_classes.empty() || !p.place_classes.empty();
        need(moved || p.opacity < 65535 || p.hidden || !p.colour.empty(), "CHK-11",
             "a pose that does nothing", p.at);
    }
}

static void check_networks(const File &f, Budget &budget) {
    for (const Netw &n : f.networks) {
        need(n.channels <= f.head.channels, "CHK-12", "more channels than HEAD has", n.at);
        const int64_t width = n.hidden, encoded = (int64_t)n.dim * (2 * n.octaves + 1);
        budget.spend(PARAMETERS, (encoded + 1) * width + (n.depth - 1) * (width + 1) * width +
                                     (width + 1) * n.channels);
    }
}

static void check_plans(const File &f, Budget &budget) {
    for (const Plan &p : f.plans) {
        const int64_t columns = over(p.width, p.levels) << p.levels, rows = over(p.height, p.levels) << p.levels;
        budget.spend(WAVEFRONTS, columns + 3 * rows);
        budget.spend(SAMPLES, columns * rows);
        supported(Models::registered(p.model), "PYR-1", "the model is not known", p.at);
        need(p.components != 2, "PYR-2", "2 components: they are 1 or 3", p.at);
        need(p.grey <= p.levels && (p.components == 3 || p.grey == p.levels), "PYR-2",
             "levels without chroma do not fit", p.at);
        need(p.lowest.size() == (size_t)p.components && p.shifts.size() == 2 * (size_t)p.levels, "PYR-2",
             "scales or shifts do not fit the levels", p.at);
        need(!p.tile || p.tile >= 6, "PYR-54", "a tile is too small", p.at);
        need(p.details.empty() || p.details.size() == (size_t)p.levels, "PYR-54",
             "details do not fit the levels", p.at);
    }
    std::vector<bool> used(f.plans.size());
    for (const Texr &t : f.textures) {
        if (t.coder != PYRAMID) continue;
        for (const int number : {t.planes + 1, t.alpha, t.behind, t.behind_alpha, t.matte}) {
            need((size_t)number <= used.size(), "PYR-3", "planes that do not exist", t.at);
            if (number) used[number - 1] = true;
        }
    }
    for (size_t k = 0; k < used.size(); k++) need(used[k], "PYR-3", "planes are not used", f.plans[k].at);
}

// PYR-47 and PYR-48, but for what `sources` decode to.
static void check_hidden(const File &f, const Texr &t) {
    need(!t.behind_alpha || (t.behind && t.alpha), "PYR-47", "behind_alpha without behind, or without alpha",
         t.at);
    for (const int number : {t.behind, t.behind_alpha}) {
        if (!number) continue;
        const Plan &own = f.plans[number - 1];
        need(own.width == t.part[2] && own.height == t.part[3], "PYR-47",
             "planes behind have not the size of the part", t.at);
    }
    if (t.behind) {
        const int own = f.plans[t.behind - 1].components;
        need(own == 3 || own == f.plans[t.planes].components, "PYR-47", "planes behind have wrong components",
             t.at);
    }
    need(!t.behind_alpha || f.plans[t.behind_alpha - 1].components == 1, "PYR-47",
         "planes behind have wrong components", t.at);
    need(t.offsets.size() % 2 == 0 && t.offsets.size() <= 510, "PYR-48", "offsets are not up to 255 pairs",
         t.at);
    need(t.offsets.empty() == t.sources.empty(), "PYR-48", "sources or offsets without the other", t.at);
    need(!t.offsets.empty() || !t.grain, "PYR-48", "a grain without sources", t.at);
    need(t.offsets.empty() || over(t.part[2], t.grain) * over(t.part[3], t.grain) <= 65536, "PYR-48",
         "sources have too many cells", t.at);
}

// PYR-38 to PYR-40, and PYR-53.
static void check_view(const File &f, const Texr &t, int k) {
    const auto &[x, y, w, h] = t.part;
    const Plan &planes = f.plans[t.planes];
    need(w >= 1 && h >= 1 && x + w <= planes.width && y + h <= planes.height, "PYR-38",
         "the part is empty or leaves the planes", t.at);
    if (t.alpha) {
        const Plan &own = f.plans[t.alpha - 1];
        need(own.components == 1 && f.head.channels == 4, "PYR-38", "alpha from planes of colour", t.at);
        need(own.width == planes.width && own.height == planes.height, "PYR-38",
             "planes of alpha have another size", t.at);
    }
    if (t.matte) {
        const Plan &own = f.plans[t.matte - 1];
        need(own.components == 1 && f.head.channels == 4, "PYR-53", "a matte from planes of colour", t.at);
        need(own.width == w && own.height == h, "PYR-53", "a matte has not the size of the part", t.at);
        need(t.behind && !t.unmix, "PYR-53", "a matte without behind, or with unmix", t.at);
    }
    need(!t.mask.empty() || !t.cell, "PYR-39", "cells without a mask", t.at);
    check_hidden(f, t);
    if (t.cuts.empty()) return;
    const Layr &layer = f.layers[k];
    need(w == layer.box[2] && h == layer.box[3], "PYR-40", "a part with cuts has not the size of the box", t.at);
    int least = k;
    for (const int cut : t.cuts) {
        need(cut >= least && cut < f.head.layers, "PYR-40", "cuts do not ascend, lie behind, or do not exist",
             t.at);
        need(!f.layers[cut].segments.empty(), "PYR-40", "a layer that cuts has no boundary", t.at);
        least = cut + 1;
    }
}

// What decoding a coded array costs.
static void spend_array(Budget &budget, int64_t columns, int64_t rows, int channels) {
    budget.spend(WAVEFRONTS, columns + 2 * rows);
    budget.spend(CODES, columns * rows * channels);
}

// What decoding and filling a view costs, without its planes.
static void spend_view(const Texr &t, int k, Budget &budget) {
    const int64_t w = t.part[2], h = t.part[3];
    if (!t.mask.empty() || !t.cuts.empty() || t.matte) budget.spend(FILLED, (t.sources.empty() ? 1 : 2) * w * h);
    if (!t.cuts.empty()) {
        const int64_t layers = (int64_t)t.cuts.size() + (t.cuts[0] == k ? k : 0);
        budget.spend(COVERED, std::min(w * h, (int64_t)1 << 44) * layers);  // which does not overflow
    }
    if (!t.mask.empty()) spend_array(budget, over(w, t.cell), over(h, t.cell), 1);
    if (!t.sources.empty())
        spend_array(budget, over(w, t.grain), over(h, t.grain), t.offsets.size() > 30 ? 2 : 1);
}

static void check_textures(const File &f, Budget &budget) {
    for (int k = 0; k < f.head.layers; k++) {
        const Texr &t = f.textures[k];
        const int sampling = f.layers[k].sampling;
        if (t.coder == SHARED) {
            need(t.texture < k, "CHK-15", "a shared texture is not that of an earlier layer", t.at);
            const Texr &source = f.textures[t.texture];
            need(source.coder != SHARED, "CHK-15", "a shared texture is shared itself", t.at);
            need((sampling == 1) == (f.layers[t.texture].sampling == 1), "CHK-15",
                 "a shared texture has another number of features", t.at);
        }
        const Texr &shown = f.textures[f.source(k)];
        need(shown.coder == IMPLICIT || sampling == 0, "CHK-7", "node sampling needs an implicit texture", t.at);
        if (t.coder == IMPLICIT) {
            need((size_t)t.network < f.networks.size(), "CHK-14", "the network does not exist", t.at);
            const int dim = f.networks[t.network].dim;
            need(sampling != 1 || dim % 2 == 0, "CHK-7", "node sampling needs an even number of features", t.at);
            spend_array(budget, t.columns, t.rows, dim);
        } else if (t.coder == PYRAMID) {
            check_view(f, t, k);
            spend_view(t, k, budget);
        }
    }
}

// CHK-3.
static void check_opaque(const File &f) {
    if (!f.head.opaque) return;
    const Texr &t = f.textures[0];
    const Place at = f.layers[0].at;
    need(f.layers[0].segments.empty(), "CHK-3", "the back layer of an opaque file has a boundary", at);
    const bool clear = t.coder == IMPLICIT ? f.networks[t.network].channels == 4 : t.alpha || t.matte;
    need(!clear, "CHK-3", "the back layer of an opaque file gives alpha", t.at);
    const Pose &p = f.pose(0);
    need(p.identity() && p.opacity == 65535 && !p.hidden && p.node_classes.empty(), "CHK-3",
         "the back layer of an opaque file has moved", at);
}

// MOT-1, and what is known of the cost before meshes are decoded.
static void check_motion(const File &f, Budget &budget) {
    if (!f.moves) return;
    const Motn &m = f.motion;
    need(!m.layers.empty() && m.layers.size() == m.bodies.size(), "MOT-1",
         "a motion of no layer, or bodies that do not fit", m.at);
    int least = f.head.opaque ? 1 : 0;
    for (const int layer : m.layers) {
        need(layer >= least, "MOT-1", "layers of a motion do not ascend, or the opaque back layer moves", m.at);
        need(of_layer(f.meshes, layer), "MOT-1", "a layer moves that has no mesh", m.at);
        least = layer + 1;
    }
    need((m.size == 0) == m.script.empty(), "MOT-1", "the script and its size do not fit", m.at);
    const int64_t coefficients = (int64_t)m.layers.size() * (m.intervals + (m.loop ? 0 : 3));
    budget.check(WAVEFRONTS, coefficients + 2);
    budget.check(MOTION, m.modes * coefficients);
}

void check_file(const File &f, Budget &budget) {
    check_counts(f, budget);
    check_layers(f, budget);
    check_poses(f);
    check_networks(f, budget);
    check_plans(f, budget);
    check_textures(f, budget);
    check_opaque(f);
    check_motion(f, budget);
}

}  // namespace pxi
