// Latents of a raster, decoded as far as they are asked for: levels, and tiles of them (chapter 8).
#pragma once

#include <atomic>
#include <optional>

#include "arrival.h"
#include "coded.h"
#include "core.h"
#include "models.h"
#include "watch.h"
#include "window.h"

namespace pxi {

// Sizes of the planes of a raster.
struct Grid {
    int width, height, levels;
    bool padded;  // to multiples of 2**levels

    explicit Grid(const Plan &plan);
    Shape at(int level) const;  // of the positions of a level; at level 0 of the samples
    // Tiles of a level that has restart points (PYR-54), row by row.
    std::vector<Window> tiles(int level, int log2) const;
    // Bit b is set where the latents of band b are coded (PYR-6); `cells` that have any, or empty: all.
    std::vector<uint8_t> bands(const std::vector<uint8_t> &cells, int cell, int level) const;
    // Whether the first position of a window has any, if all cells do.
    bool first(int level, Window window) const;
};

// A stream of latents, and its escapes.
class LatentStream {
    Stream stream;
    Bytes data, escapes;
    int64_t escapes_used = 0;
    Place at;

  public:
    LatentStream(Bytes data, Bytes escapes, const Place &at) : stream(data, at), data(data), escapes(escapes), at(at) {}
    loops::Source source();
    void advance(const loops::Source &to);
    void finish() const;
};

class Latents {
    const Plan &plan;
    const Weights &weights;
    const Watch &watch;
    const Grid grid;
    std::vector<uint8_t> cells;  // that have latents; empty: all
    std::vector<int32_t> lowest_planes;
    ByLevel<Zeros<int32_t>> levels, plains;
    ByLevel<Made> made;  // of `plains`
    ByLevel<std::vector<uint8_t>> coded;
    std::optional<LatentStream> first;  // the stream of all that has no tiles
    std::atomic<int> read;              // the finest level that it was read of
    struct Tile {
        Window at;
        Bytes escapes, data;
    };
    bool indexed = false;
    ByLevel<std::vector<Tile>> tiles;  // that are not read yet

    const std::vector<uint8_t> &bands(int level);
    void decode(LatentStream &stream, int level, Shape shape, const int32_t *low, const int32_t *parent,
                const uint8_t *bands, int32_t *out, const Watch &heard) const;
    // Reads one more level; `arrival`, which may be null, hears of its rows.
    void read_level(int level, Arrival *arrival = nullptr);
    void read_tiles(int level, const std::vector<Tile> &wanted);
    bool any(int level, Window window);
    void index();
    std::vector<Tile> split() const;

  public:
    Latents(const Plan &plan, const Weights &weights, const Watch &watch);

    const std::vector<int32_t> &lowest();               // [3][h][w]
    const int32_t *level(int level, Window window);     // [9][h][w], of which the window is decoded
    const int32_t *plain(int level, Window window);     // [3][h][w] in 1/16, of which the window is made
    void forget();

    // Whether a level that is not read yet is one stream, so that it can be read while its first rows are used.
    bool flows(int level) const { return grid.tiles(level, plan.tile).empty() && read > level; }
    // Reads all that such a level needs; then the level, while another thread may ask for coarser ones.
    void prepare(int level);
    void read_into(int level, Arrival &arrival) { read_level(level, &arrival); }
};

// Which cells of a plan have latents; empty: all (PYR-5).
std::vector<uint8_t> support_of(const Plan &plan);

}  // namespace pxi
