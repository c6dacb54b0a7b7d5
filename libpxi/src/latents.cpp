#include "latents.h"

#include "latent_tables.h"
#include "parallel.h"

namespace pxi {

static const int STEP_ORIGIN = 293, SHIFT_ORIGIN = 8;
// Positions around a tile whose coarser levels its context depends on: 3, made even; and positions around
// a window that the plain wavelet needs.
static const int REACH = 4, AROUND = 3;
static const int STRIP = 128;  // rows that a thread makes at once, which bounds memory
// Taps of the plain wavelet [low, high][even, odd][5] in 1/256 (PYR-16).
static const int32_t TAPS[] = {0, -10, 202, -10, 0, 0, -17, 107, 107, -17,
                               6, -97, -97, 6,   0, 10, -28, 218, -28, 10};

loops::Source LatentStream::source() {
    return {stream.words.data(), stream.states.data(), escapes.data(), (int64_t)stream.words.size(), stream.used,
            (int64_t)escapes.size(), escapes_used, (int32_t)stream.states.size()};
}

void LatentStream::advance(const loops::Source &to) { stream.used = to.used, escapes_used = to.escapes_used; }

void LatentStream::finish() const {
    stream.finish();
    need(escapes_used == (int64_t)escapes.size(), "PYR-13", "escapes are left over", at);
    need(stream.size == data.size(), "PYR-8", "bytes are left over after the latents", at);
}

Latents::Latents(const Plan &plan, const Weights &weights, const Watch &watch)
    : plan(plan), weights(weights), watch(watch), grid(plan), cells(support_of(plan)), read(plan.levels + 1) {}

void Latents::forget() {
    levels = {}, plains = {}, made = {}, coded = {}, tiles = {};
    lowest_planes = {};
    first.reset();
    read = grid.levels + 1;
    indexed = false;
}

const std::vector<uint8_t> &Latents::bands(int level) {
    std::vector<uint8_t> &found = coded[level];
    if (found.empty()) found = grid.bands(cells, plan.cell, level);
    return found;
}

const std::vector<int32_t> &Latents::lowest() {
    if (first) return lowest_planes;
    const size_t size = plan.tile ? stream_size(plan.data, plan.at) : plan.data.size();
    LatentStream stream(plan.data.first(size), plan.escapes, plan.at);
    const Shape shape = grid.at(grid.levels);
    lowest_planes.assign(3 * shape.size(), 0);
    loops::Lowest task = {latent_tables(), stream.source(), {}, plan.components, shape.rows, shape.columns,
                          lowest_planes.data()};
    std::copy(plan.lowest.begin(), plan.lowest.end(), task.scales);
    check_core(core().pyramid_lowest(&task), plan.at);
    stream.advance(task.source);
    first.emplace(std::move(stream));
    read = grid.levels + 1;
    return lowest_planes;
}

// Decodes a level, or a part of it.
void Latents::decode(LatentStream &stream, int level, Shape shape, const int32_t *low, const int32_t *parent,
                     const uint8_t *bands, int32_t *out, const Watch &heard) const {
    const Context &c = weights.context_of(level);
    std::vector<int32_t> bias = c.first_bias;
    for (size_t i = 0; i < bias.size(); i++) bias[i] += (c.first_by_step[i] * (plan.step - STEP_ORIGIN) + 128) >> 8;
    loops::Level task = {};
    // What results keep of the bits of their units of 1/32.
    task.net = {c.first.data(), bias.data(), c.second.data(), c.second_bias.data(), c.causal.data(),
                c.mix.data(), c.mix_bias.data(), c.luma.data(), c.luma_bias.data(), c.from_luma.data(),
                c.from_luma_bias.data(), c.chroma.data(), c.chroma_bias.data(),
                -c.first_exponent, -c.second_exponent - 3, -c.causal_exponent - 3, -c.mix_exponent,
                -c.luma_exponent + 1, -c.from_luma_exponent - 3, -c.chroma_exponent + 1, weights.context};
    task.tables = latent_tables();
    task.source = stream.source();
    task.height = shape.rows, task.width = shape.columns, task.grey = level <= plan.grey;
    for (int k = 0; k < 2; k++) task.shifts[k] = plan.shifts[2 * level - 2 + k] - SHIFT_ORIGIN;
    task.logs = log_features().data(), task.n_logs = (int64_t)log_features().size();
    task.low = low, task.parent = parent, task.bands = bands, task.latents = out;
    task.watch = heard.function, task.listener = heard.user;
    check_core(core().pyramid_level(&task), plan.at);
    stream.advance(task.source);
}

void Latents::prepare(int level) {
    const Window whole = Window::whole(grid.at(level));
    plain(level, whole), this->level(level + 1, whole.halved());
}

void Latents::read_level(int level, [[maybe_unused]] Arrival *arrival) {
    const Shape shape = grid.at(level);
    const Window whole = Window::whole(shape);
    const int32_t *low = plain(level, whole), *parent = this->level(level + 1, whole.halved());
    const uint8_t *some = bands(level).data();
    LatentStream stream = std::move(*first);
    first.reset();  // it is of no use after an error
    levels[level].make(9 * shape.size());
    int32_t *out = levels[level].data();
#ifdef PXI_NO_THREADS
    decode(stream, level, shape, low, parent, some, out, watch);
#else
    if (arrival) arrival->begin(out);
    decode(stream, level, shape, low, parent, some, out, arrival ? arrival->watch() : watch);
#endif
    if (level == 1 || !grid.tiles(level - 1, plan.tile).empty()) stream.finish();
    first.emplace(std::move(stream));
    read = level;
}

const int32_t *Latents::level(int level, Window window) {
    const bool above = level > grid.levels;  // there is nothing
    const Shape coarsest = grid.at(grid.levels);
    const Shape shape = above ? Shape{(coarsest.rows + 1) / 2, (coarsest.columns + 1) / 2} : grid.at(level);
    if (!levels[level]) levels[level].make(9 * shape.size());
    if (above) return levels[level].data();
    if (grid.tiles(level, plan.tile).empty()) {
        if (read > level) lowest();
        while (read > level) read_level(read - 1);
        return levels[level].data();
    }
    index();
    std::vector<Tile> wanted, left;
    for (const Tile &tile : tiles[level]) (tile.at.meets(window) ? wanted : left).push_back(tile);
    read_tiles(level, wanted);
    tiles[level] = std::move(left);
    return levels[level].data();
}

// Decodes tiles, on several threads.
void Latents::read_tiles(int level, const std::vector<Tile> &wanted) {
    if (wanted.empty()) return;
    const Shape shape = grid.at(level);
    const bool coarsest = level == grid.levels;
    const Shape coarser = coarsest ? Shape{(shape.rows + 1) / 2, (shape.columns + 1) / 2} : grid.at(level + 1);
    Window all = wanted[0].at;
    for (const Tile &tile : wanted)
        all = {std::min(all.top, tile.at.top), std::max(all.bottom, tile.at.bottom),
               std::min(all.left, tile.at.left), std::max(all.right, tile.at.right)};
    all = all.grown(REACH, shape);
    const int32_t *low = plain(level, all), *parent = this->level(level + 1, all.halved());
    const uint8_t *coded = bands(level).data();
    int32_t *out = levels[level].data();
    parallel(watch.threads, (int64_t)wanted.size(), [&](int64_t k) {
        const Tile &tile = wanted[k];
        const Window outer = tile.at.grown(REACH, shape);
        const std::vector<int32_t> above = cut(parent, 9, coarser, outer.halved());
        const std::vector<int32_t> own = cut(low, 3, shape, outer);
        std::vector<uint8_t> some(outer.shape().size());
        paste(coded, shape, tile.at, some.data(), outer.shape(), tile.at.inside(outer), 1);
        std::vector<int32_t> found(9 * outer.shape().size());
        LatentStream stream(tile.data, tile.escapes, plan.at);
        decode(stream, level, outer.shape(), own.data(), above.data(), some.data(), found.data(), watch);
        stream.finish();
        paste(found.data(), outer.shape(), tile.at.inside(outer), out, shape, tile.at, 9);
    });
}

// Escapes and streams of all tiles, one after the other.
std::vector<Latents::Tile> Latents::split() const {
    std::vector<Tile> out;
    Bytes data = plan.data.subspan(stream_size(plan.data, plan.at));
    while (!data.empty()) {
        uint64_t count = 0;
        size_t digits = 0;
        bool more = true;
        for (; more; digits++) {
            need(digits < data.size() && digits < 5, "PYR-54", "the escapes of a tile are corrupt", plan.at);
            count |= (uint64_t)(data[digits] & 127) << 7 * digits;
            more = data[digits] > 127;
        }
        need(count <= data.size() - digits, "PYR-54", "the escapes of a tile end early", plan.at);
        const Bytes escapes = data.subspan(digits, count), rest = data.subspan(digits + count);
        const size_t size = stream_size(rest, plan.at);
        out.push_back({{}, escapes, rest.first(size)});
        data = rest.subspan(size);
    }
    return out;
}

// Whether any latent of a window is coded. Where all cells are stored, the first position has some if any has.
bool Latents::any(int level, Window window) {
    if (cells.empty()) return grid.first(level, window);
    const std::vector<uint8_t> own = cut(bands(level).data(), 1, grid.at(level), window);
    return std::any_of(own.begin(), own.end(), [](uint8_t b) { return b; });
}

void Latents::index() {
    if (indexed) return;
    const std::vector<Tile> streams = split();
    size_t next = 0;
    tiles = {};
    for (int level = grid.levels; level > 0; level--)
        for (const Window &at : grid.tiles(level, plan.tile)) {
            if (!any(level, at)) continue;
            need(next < streams.size(), "PYR-54", "the stream of a tile is missing", plan.at);
            tiles[level].push_back(streams[next++]);
            tiles[level].back().at = at;
        }
    need(next == streams.size(), "PYR-54", "there are more streams than tiles", plan.at);
    indexed = true;
}

const int32_t *Latents::plain(int level, Window window) {
    const Shape shape = grid.at(level);
    Zeros<int32_t> &out = plains[level];
    if (level == grid.levels) {
        const std::vector<int32_t> &planes = lowest();
        if (!out) out.make((int64_t)planes.size());
        for (size_t i = 0; i < planes.size(); i++) out[i] = planes[i] * 16;
        return out.data();
    }
    if (!out) out.make(3 * shape.size()), made[level] = Made(shape);
    for (const Window &part : made[level].lacking(window)) {
        const Shape coarser = grid.at(level + 1);
        const Window all = part.halved().grown(AROUND, coarser);
        const int32_t *lows = plain(level + 1, all), *highs = this->level(level + 1, all);
        parallel(watch.threads, (part.rows() + STRIP - 1) / STRIP, [&](int64_t k) {
            const int top = part.top + (int)k * STRIP;
            const Window strip = {top, std::min(top + STRIP, part.bottom), part.left, part.right};
            const Window above = strip.halved().grown(AROUND, coarser), under = above.doubled(shape);
            const std::vector<int32_t> low = cut(lows, 3, coarser, above), high = cut(highs, 9, coarser, above);
            std::vector<int32_t> found(3 * under.shape().size());
            const loops::Plain task = {low.data(), high.data(), above.rows(), above.columns(), under.rows(),
                                       under.columns(), TAPS, LATENT_LIMIT << 4, found.data()};
            check_core(core().next_plain(&task), plan.at);
            paste(found.data(), under.shape(), strip.inside(under), out.data(), shape, strip, 3);
            watch.ask();
        });
        made[level].add(part);
    }
    return out.data();
}

}  // namespace pxi
