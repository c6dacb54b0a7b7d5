#include "read.h"

#include <algorithm>
#include <cstring>

#include "chunks.h"
#include "values.h"

namespace pxi {

static const int MAPS_UNTIL = 3;  // the last version whose payloads may be maps (CON-17)
static const int64_t K16 = 1 << 16, M16 = 1 << 24, MOST = ((int64_t)1 << 31) - 1, FAR = ((int64_t)1 << 33) - 1;

static void read_head(Values &v, Head &h) {
    int size[2];
    v.integers("size", 1, M16, size, 2);
    h.width = size[0], h.height = size[1];
    h.channels = (int)v.integer("channels", 3, 4);
    h.opaque = v.integer("opaque", 0, 1);
    h.depth = (int)v.integer("depth", 8, 16);
    h.layers = (int)v.integer("layers", 1, K16);
    h.networks = (int)v.integer("networks", 0, K16);
}

static void read_layer(Values &v, Layr &l) {
    l.name = v.text("name", 1, 255);
    v.integers("box", -M16, M16, l.box.data(), 4);
    l.sampling = (int)v.integer("sampling", 0, 255);
    l.unit = (int)v.integer("unit", 0, 6);
    l.segments = v.integers("segments", 1, M16);
    l.classes = v.binary("classes");
    l.deltas = v.binary("deltas");
}

static void read_mesh(Values &v, Mesh &m) {
    m.layer = (int)v.integer("layer", 0, K16);
    v.integers("origin", -M16, M16, m.origin.data(), 2);
    v.integers("step", 1, M16, m.step.data(), 2);
    m.vertices = (int)v.integer("vertices", 3, K16);
    m.gates = (int)v.integer("gates", 3, 1 << 20);
    m.symbols = v.binary("symbols");
    m.far = v.integers("far", 0, K16);
    m.classes = v.binary("classes");
    m.deltas = v.binary("deltas");
    m.levels = (int)v.integer("levels", 0, 4);
    m.splits = v.binary("splits");
}

static void read_pose(Values &v, Pose &p) {
    p.layer = (int)v.integer("layer", 0, K16);
    v.wide("matrix", -MOST, MOST, p.matrix.data(), 4);
    v.wide("shift", -FAR, FAR, p.shift.data(), 2);
    p.opacity = (int)v.integer("opacity", 0, 65535);
    p.hidden = v.integer("hidden", 0, 1);
    p.colour = v.integers("colour", -(1 << 20), 1 << 20);
    p.node_classes = v.binary("node_classes");
    p.node_deltas = v.binary("node_deltas");
    p.place_classes = v.binary("place_classes");
    p.place_deltas = v.binary("place_deltas");
}

static void read_network(Values &v, Netw &n) {
    n.dim = (int)v.integer("dim", 1, 64);
    n.octaves = (int)v.integer("octaves", 0, 12);
    n.hidden = (int)v.integer("hidden", 1, 1024);
    n.depth = (int)v.integer("depth", 1, 8);
    n.channels = (int)v.integer("channels", 3, 4);
    n.bits = (int)v.integer("bits", 2, 8);
    n.steps = v.binary("steps");
    n.biases = v.binary("biases");
    n.weights = v.binary("weights");
}

static void read_plan(Values &v, Plan &p, int minor) {
    p.model = (int)v.integer("model", 0, 65535);
    int size[2];
    v.integers("size", 1, M16, size, 2);
    p.width = size[0], p.height = size[1];
    p.components = (int)v.integer("components", 1, 3);
    p.step = (int)v.integer("step", 0, 640);
    p.levels = (int)v.integer("levels", 1, 8);
    p.grey = (int)v.integer("grey", 0, 8);
    p.lowest = v.integers("lowest", 0, 63);
    p.shifts = v.integers("shifts", 0, 15);
    p.cell = (int)v.integer("cell", 1, 8);
    p.support = v.binary("support");
    p.tile = minor < 12 ? 0 : (int)v.integer("tile", 0, 12);  // CON-20
    if (minor >= 12) p.details = v.integers("details", 0, 255);
    p.escapes = v.binary("escapes");
    p.data = v.binary("data");
}

static void read_view(Values &v, Texr &t, int minor) {
    t.planes = (int)v.integer("planes", 0, K16);
    t.alpha = (int)v.integer("alpha", 0, K16);
    v.integers("part", 0, M16, t.part.data(), 4);
    t.cell = (int)v.integer("cell", 0, 6);
    t.mask = v.binary("mask");
    t.cuts = v.integers("cuts", 0, K16);
    if (minor >= 11) {  // CON-19
        t.behind = (int)v.integer("behind", 0, K16);
        t.behind_alpha = (int)v.integer("behind_alpha", 0, K16);
        t.grain = (int)v.integer("grain", 0, 6);
        t.offsets = v.integers("offsets", -M16, M16);
        t.sources = v.binary("sources");
        t.unmix = (int)v.integer("unmix", 0, 1);
    }
    if (minor >= 12) t.matte = (int)v.integer("matte", 0, K16);
}

static void read_texture(Values &v, Texr &t, int minor) {
    const int64_t coder = v.integer("coder", 0, 255);
    supported(coder <= PYRAMID, "CHK-13", "the coder of a texture is not known", t.at);
    if (minor > MAPS_UNTIL) v.refuse_map();
    t.coder = (Coder)coder;
    if (t.coder == SHARED) t.texture = (int)v.integer("texture", 0, K16);
    if (t.coder == PYRAMID) read_view(v, t, minor);
    if (t.coder != IMPLICIT) return;
    t.network = (int)v.integer("network", 0, K16);
    int grid[2];
    v.integers("grid", 2, M16, grid, 2);
    t.columns = grid[0], t.rows = grid[1];
    t.bits = (int)v.integer("bits", 2, 8);
    t.steps = v.binary("steps");
    t.stored = v.binary("stored");
    t.codes = v.binary("codes");
}

static void read_motion(Values &v, Motn &m) {
    m.duration = (int)v.integer("duration", 1, 3600000);
    m.fps = (int)v.integer("fps", 1, 240);
    m.loop = (int)v.integer("loop", 0, 1);
    m.intervals = (int)v.integer("intervals", 1, K16);
    m.unit = (int)v.integer("unit", 0, 6);
    m.layers = v.integers("layers", 0, K16);
    m.bodies = v.integers("bodies", 0, K16);
    m.modes = (int)v.integer("modes", 1, 64);
    m.curve_classes = v.binary("curve_classes");
    m.curve_deltas = v.binary("curve_deltas");
    m.shape_classes = v.binary("shape_classes");
    m.shape_deltas = v.binary("shape_deltas");
    m.size = (int)v.integer("size", 0, MOST);
    m.script = v.binary("script");
}

// What the next chunk of a kind becomes.
template <class Item> static Item &next(std::vector<Item> &all, const Place &at) {
    all.emplace_back();
    all.back().at = at;
    return all.back();
}

// Refuses layers that do not ascend, of chunks that come once a layer (CHK-9, CHK-10).
template <class Item> static void check_order(const std::vector<Item> &all, const char *rule) {
    const size_t count = all.size();
    need(count < 2 || all[count - 2].layer < all.back().layer, rule, "layers do not ascend", all.back().at);
}

// A chunk of metadata. Groups are checked for nobody here, and a history is not looked into (CON-9).
static void read_metadata(File &f, const Chunk &chunk, Values v, Budget &budget) {
    const auto is = [&](const char *type) { return !std::strcmp(chunk.at.chunk, type); };
    if (is("cICp")) {
        f.primaries = (int)v.integer("primaries", 1, 255);
        f.transfer = (int)v.integer("transfer", 1, 255);
    } else if (is("iNFO")) {
        v.text("encoder", 0, 255);
        v.text("settings", 0, K16);
        const size_t areas = v.areas("areas", (int64_t)1 << 48);
        need(!areas || areas == f.layers.size(), "CHK-17", "areas are not one a layer",
             chunk.at);
    } else {
        const int64_t size = v.integer("size", 1, MOST);
        const Bytes frame = v.binary("zstd");
        const char *kind = is("iCCp") ? "icc" : is("eXIf") ? "exif" : "xmp";
        f.blocks.push_back({kind, decompressed(frame, size, chunk.at, budget)});
    }
    v.end();
}

static void read_chunk(File &f, const Chunk &chunk, Budget &budget, bool blocks) {
    const auto is = [&](const char *type) { return !std::strcmp(chunk.at.chunk, type); };
    const Place &at = chunk.at;
    if (is("uNDO") || is("tREE")) return;
    const bool metadata = is("iCCp") || is("eXIf") || is("xMPd") || is("cICp") || is("iNFO");
    if (metadata && !blocks) return;
    Values v(chunk.payload, at, f.minor <= MAPS_UNTIL || is("TEXR"));  // whose coder comes first (CHK-13)
    if (metadata) return read_metadata(f, chunk, v, budget);
    if (is("HEAD")) {
        read_head(v, f.head);
    } else if (is("LAYR")) {
        budget.check(LAYERS, (int64_t)f.layers.size() + 1);
        read_layer(v, next(f.layers, at));
    } else if (is("MESH")) {
        read_mesh(v, next(f.meshes, at));
        check_order(f.meshes, "CHK-9");
    } else if (is("POSE")) {
        read_pose(v, next(f.poses, at));
        check_order(f.poses, "CHK-10");
    } else if (is("NETW")) {
        budget.check(NETWORKS, (int64_t)f.networks.size() + 1);
        read_network(v, next(f.networks, at));
    } else if (is("TEXR")) {
        read_texture(v, next(f.textures, at), f.minor);
    } else if (is("PLAN")) {
        read_plan(v, next(f.plans, at), f.minor);
    } else {
        f.motion.at = at;
        read_motion(v, f.motion);
        f.moves = true;
    }
    v.end();
}

// The script is looked at, as it may be broken, and then dropped (MOT-1, MOT-10).
static void check_script(const Motn &m, Budget &budget) {
    if (!m.size) return;
    const std::vector<uint8_t> text = decompressed(m.script, m.size, m.at, budget);
    need(characters(text) >= 0, "MOT-10", "the script is not UTF-8", m.at);
}

static void decode_textures(File &f) {
    for (size_t k = 0; k < f.textures.size(); k++) {
        Texr &t = f.textures[k];
        if (t.coder == IMPLICIT) decode_codes(t, f.networks[t.network].dim / (f.layers[k].sampling == 1 ? 2 : 1));
        if (t.coder == PYRAMID) decode_cells(t);
    }
}

std::unique_ptr<File> read_file(Bytes data, Budget &budget, bool blocks) {
    auto file = std::make_unique<File>();
    File &f = *file;
    f.bytes.assign(data.begin(), data.end());
    const Framed framed = read_chunks(f.bytes, budget);
    f.minor = framed.minor;
    for (const Chunk &chunk : framed.chunks) read_chunk(f, chunk, budget, blocks);
    check_file(f, budget);
    for (Netw &network : f.networks) decode_network(network);
    decode_textures(f);
    if (f.moves) check_script(f.motion, budget);
    return file;
}

}  // namespace pxi
