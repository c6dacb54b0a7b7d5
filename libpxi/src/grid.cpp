// Sizes of planes, and which of their latents are coded.
#include "latents.h"

namespace pxi {

Grid::Grid(const Plan &p) : width(p.width), height(p.height), levels(p.levels), padded(Models::padded(p.model)) {}

static int over(int n, int log2) { return (int)(((int64_t)n + (1 << log2) - 1) >> log2); }

Shape Grid::at(int level) const {
    if (padded) return {over(height, levels) << (levels - level), over(width, levels) << (levels - level)};
    return {over(height, level), over(width, level)};
}

std::vector<Window> Grid::tiles(int level, int log2) const {
    const auto [rows, columns] = at(level);
    const int side = 1 << log2;
    std::vector<Window> out;
    if (!log2 || std::max(rows, columns) <= side) return out;
    for (int y = 0; y < rows; y += side)
        for (int x = 0; x < columns; x += side)
            out.push_back({y, std::min(y + side, rows), x, std::min(x + side, columns)});
    return out;
}

// Positions of a level that lie over a sample of a cell.
static std::vector<uint8_t> over_cells(const Grid &g, const std::vector<uint8_t> &cells, int cell, int level) {
    const auto [rows, columns] = g.at(level);
    std::vector<uint8_t> out((int64_t)rows * columns);
    const int high = over(g.height, level), wide = over(g.width, level);
    const int down = over(g.height, cell), across = over(g.width, cell);
    if (cells.empty()) {
        for (int y = 0; y < high; y++) std::fill_n(out.begin() + (int64_t)y * columns, wide, 1);
    } else if (level < cell) {
        for (int y = 0; y < high; y++)
            for (int x = 0; x < wide; x++)
                out[(int64_t)y * columns + x] = cells[(int64_t)(y >> (cell - level)) * across + (x >> (cell - level))];
    } else {
        for (int j = 0; j < down; j++)
            for (int i = 0; i < across; i++)
                if (cells[(int64_t)j * across + i])
                    out[(int64_t)(j >> (level - cell)) * columns + (i >> (level - cell))] = 1;
    }
    return out;
}

static std::vector<uint8_t> grown(const std::vector<uint8_t> &from, Shape shape) {
    std::vector<uint8_t> out(from.size());
    for (int y = 0; y < shape.rows; y++)
        for (int x = 0; x < shape.columns; x++) {
            if (!from[(int64_t)y * shape.columns + x]) continue;
            const Window near = Window{y, y + 1, x, x + 1}.grown(1, shape);
            for (int j = near.top; j < near.bottom; j++)
                std::fill_n(out.begin() + (int64_t)j * shape.columns + near.left, near.columns(), 1);
        }
    return out;
}

std::vector<uint8_t> Grid::bands(const std::vector<uint8_t> &cells, int cell, int level) const {
    const Shape shape = at(level), finer = at(level - 1);
    std::vector<uint8_t> out = over_cells(*this, cells, cell, level);
    if (!cells.empty() && level >= cell && !padded) out = grown(out, shape);
    // A high-pass band has one sample less than positions where it halves an odd number of samples.
    for (int y = 0; y < shape.rows; y++)
        for (int x = 0; x < shape.columns; x++) {
            const int down = y < finer.rows / 2 ? 2 : 0, across = x < finer.columns / 2 ? 1 : 0;
            uint8_t &bits = out[(int64_t)y * shape.columns + x];
            bits = bits ? (uint8_t)(across | down | (across && down ? 4 : 0)) : 0;
        }
    return out;
}

bool Grid::first(int level, Window w) const {
    const Shape finer = at(level - 1);
    return w.top < over(height, level) && w.left < over(width, level) &&
           (w.top < finer.rows / 2 || w.left < finer.columns / 2);
}

std::vector<uint8_t> support_of(const Plan &p) {
    if (p.support.empty()) return {};
    return decode_mask(p.support, over(p.height, p.cell), over(p.width, p.cell), "PYR-5", p.at);
}

}  // namespace pxi
