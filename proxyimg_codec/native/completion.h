// Completion by reference, texture/completion.py and texture/lifts.py; numpy is their judge, bit for bit.
#pragma once

#include "diffusion.h"

namespace PXI_LEVEL {

struct Copies {               // what is completed, and from where
    Plane plane;              // values are completed in place
    uint8_t *known;           // [height][width], of the plane; set for samples that are completed
    const int32_t *offsets;   // [n][2] dx, dy
    const uint8_t *sources;   // [rows][columns] 1 + the number of an offset, or 0
    int32_t rows, columns, grain;
    int32_t drift, most;      // largest correction; largest value
};

// A cell with a source.
struct Cell {
    int row, column, shift[2];  // dx, dy
    int64_t weight, total;    // of what is known around it; of all that it is balanced with
};

// Lifts of cells, so that neighbours agree in light.
class Lifts {
    static constexpr int64_t LIMIT = 24 << 8, APART = 48 << 8, MOST = 32640, TURNS = 64, RIM_WEIGHT = 4;

    const Copies &s;
    const int side, channels, height, width;
    std::vector<Cell> cells;
    std::vector<int> number;               // [rows + 2][columns + 2] of the cells with a source, or -1
    std::vector<int64_t> aim, excess[2];   // [cells][channels]; of copies over those of the right, lower cell
    std::vector<uint8_t> linked[2];        // [cells] to the right one, to the lower one
    std::vector<int64_t> lift;             // [cells][channels]

    // Means of what one shift finds over what another one does, bounded, in a square of the part; returns
    // how many samples both find, or 0 where they are apart.
    int64_t compared(int top, int left, int size, const int *one, const int *other, int64_t *out) const {
        const int y0 = std::max({top, 0, -one[1], -other[1]}), x0 = std::max({left, 0, -one[0], -other[0]});
        const int y1 = std::min({top + size, height, height - one[1], height - other[1]});
        const int x1 = std::min({left + size, width, width - one[0], width - other[0]});
        std::fill_n(out, channels, 0);
        int64_t count = 0;
        for (int y = y0; y < y1; y++) {
            const int64_t a = (int64_t)(y + one[1]) * width + one[0];
            const int64_t b = (int64_t)(y + other[1]) * width + other[0];
            const uint8_t *k = s.known + a, *l = s.known + b;
            int32_t row = 0;  // at most 128 samples
            for (int x = x0; x < x1; x++) row += k[x] & l[x];
            if (!row) continue;
            count += row;
            for (int c = 0; c < channels; c++) {
                const int32_t *v = s.plane.values + c * s.plane.size() + a, *w = v + (b - a);
                int32_t sum = 0;
                for (int x = x0; x < x1; x++) sum += k[x] & l[x] ? v[x] - w[x] : 0;
                out[c] += sum;
            }
        }
        const int64_t twice = std::max<int64_t>(2 * count, 1);
        bool apart = false;
        for (int c = 0; c < channels; c++) {
            out[c] = floor_divided(2 * out[c] + count, twice);
            apart |= std::abs(out[c]) > APART;
            out[c] = std::clamp(out[c], -LIMIT, LIMIT);
        }
        if (!apart) return count;
        std::fill_n(out, channels, 0);
        return 0;
    }

    // What is known around a cell misses of its copies.
    void rim(int n) {
        Cell &cell = cells[n];
        const int here[2] = {0, 0}, less = side / 2;
        const int64_t whole = (int64_t)side * side;
        const int64_t count = compared(cell.row * side - less, cell.column * side - less, 2 * side - side % 2,
                                       here, cell.shift, aim.data() + (int64_t)n * channels);
        cell.weight = (RIM_WEIGHT * std::min(count, whole) + whole - 1) / whole;
        cell.total += cell.weight;
    }

    // Excess of copies of a cell over those of its neighbour below or to the right.
    void between(int n, int down) {
        Cell &cell = cells[n];
        const int next = beside(n, down, !down), more = side / 2;
        if (next < 0) return;
        const int top = cell.row * side + down * more, left = cell.column * side + !down * more;
        int64_t *out = excess[down].data() + (int64_t)n * channels;
        if (!compared(top, left, side, cell.shift, cells[next].shift, out)) return;
        linked[down][n] = 1;
        cell.total++, cells[next].total++;
    }

    int beside(int n, int down, int right) const {
        return number[(cells[n].row + 1 + down) * (s.columns + 2) + cells[n].column + 1 + right];
    }

    void balance(int n) {
        const Cell &cell = cells[n];
        for (int c = 0; c < channels; c++) {
            const auto at = [&](int i) { return (int64_t)i * channels + c; };
            int64_t wanted = cell.weight * aim[at(n)], &own = lift[at(n)];
            for (int down = 0; down < 2; down++) {
                if (linked[down][n]) wanted += lift[at(beside(n, down, !down))] - excess[down][at(n)];
                const int back = beside(n, -down, -!down);
                if (back >= 0 && linked[down][back]) wanted += lift[at(back)] + excess[down][at(back)];
            }
            const int64_t missing = 7 * (wanted - cell.total * own);
            own += floor_divided(missing + 2 * cell.total, 4 * cell.total);
            own = std::clamp(own, -MOST, MOST);
        }
    }

  public:
    explicit Lifts(const Copies &copies)
        : s(copies), side(1 << s.grain), channels(s.plane.channels), height(s.plane.height),
          width(s.plane.width), number((size_t)(s.rows + 2) * (s.columns + 2), -1) {
        for (int j = 0; j < s.rows; j++)
            for (int i = 0; i < s.columns; i++)
                if (const int source = s.sources[(int64_t)j * s.columns + i]) {
                    number[(j + 1) * (s.columns + 2) + i + 1] = (int)cells.size();
                    cells.push_back({j, i, {s.offsets[2 * source - 2], s.offsets[2 * source - 1]}, 0, 0});
                }
        const size_t count = cells.size();
        for (std::vector<int64_t> *v : {&aim, &excess[0], &excess[1], &lift}) v->resize(count * channels);
        for (auto &v : linked) v.resize(count);
        for (int n = 0; n < (int)count; n++) {
            rim(n);
            for (int down = 0; down < 2; down++) between(n, down);
        }
        for (int turn = 0; turn < 2 * TURNS; turn++)
            for (int n = 0; n < (int)count; n++)
                if ((cells[n].row + cells[n].column) % 2 == turn % 2 && cells[n].total > 0) balance(n);
    }
    // Number of the cell after k rows and m columns of cells, of which the first lies before the part.
    int at(int k, int m) const { return number[k * (s.columns + 2) + m]; }
    const Cell &cell(int n) const { return cells[n]; }
    const int64_t *of(int n) const { return lift.data() + (int64_t)n * channels; }
};

// Samples that have a base: what cells copy there, blended and lifted.
struct Bases {
    std::vector<int64_t> at;     // ascending
    std::vector<int32_t> values; // [at][channels]
};

template <int C> Bases bases_of(const Copies &s) {
    const Lifts lifts(s);
    const int side = 1 << s.grain, whole = 2 * side, bits = 2 * (s.grain + 1);
    const int height = s.plane.height, width = s.plane.width;
    const int64_t size = s.plane.size();
    Bases out;
    // a / weight, rounded to nearest; weights mostly add up to a power of two. All fits 32 bits.
    const auto divided = [&](int32_t a, int32_t weight) {
        return weight >> bits ? (2 * a + weight) >> (bits + 1) : floor_divided(2 * a + weight, 2 * weight);
    };
    for (int y = 0; y < height; y++) {
        const int k = (2 * y + 1 + side) >> (s.grain + 1), f = 2 * y + 1 + side - k * whole;
        for (int m = 0, x = 0; x < width; m++) {  // columns between the same two cells
            const int end = std::min((m + 1) * side - (side + 1) / 2, width);
            struct {
                int first, last, weight, right;  // columns with something to copy
                int64_t from;                    // distance to it from the sample's column
                const int64_t *lift;
            } near[4], *there = near;
            for (int corner = 0; corner < 4; corner++) {
                const int below = corner >> 1, right = corner & 1, n = lifts.at(k + below, m + right);
                if (n < 0) continue;
                const int *shift = lifts.cell(n).shift, v = y + shift[1];
                if (v < 0 || v >= height) continue;
                *there++ = {-shift[0], width - shift[0], below ? f : whole - f, right,
                            (int64_t)v * width + shift[0], lifts.of(n)};
            }
            if (there == near) x = std::max(x, end);
            for (; x < end; x++) {
                const int g = 2 * x + 1 + side - m * whole;
                int32_t weight = 0, total[C] = {}, lifted[C] = {};
                for (const auto *cell = near; cell < there; cell++) {
                    if (x < cell->first || x >= cell->last || !s.known[cell->from + x]) continue;
                    const int32_t w = cell->weight * (cell->right ? g : whole - g);
                    weight += w;
                    for (int c = 0; c < C; c++) {
                        total[c] += w * s.plane.values[c * size + cell->from + x];
                        lifted[c] += w * (int32_t)cell->lift[c];
                    }
                }
                if (!weight) continue;
                out.at.push_back((int64_t)y * width + x);
                for (int c = 0; c < C; c++)
                    out.values.push_back(divided(total[c], weight) + divided(lifted[c], weight));
            }
        }
    }
    return out;
}

// Completes unknown samples of up to four channels.
inline void complete(Copies &s) {
    static constexpr Bases (*OF[])(const Copies &) = {bases_of<1>, bases_of<2>, bases_of<3>, bases_of<4>};
    const Bases bases = OF[s.plane.channels - 1](s);
    const int channels = s.plane.channels;
    const int64_t size = s.plane.size();
    std::vector<uint8_t> beside(size), done(size, 1);
    std::vector<int32_t> residual((size_t)size * channels);
    bool any = false, rim = false;
    for (size_t i = 0; i < bases.at.size(); i++) {
        const int64_t at = bases.at[i];
        if (!s.known[at]) {
            done[at] = 0, any = true;
            continue;
        }
        beside[at] = 1, rim = true;
        for (int c = 0; c < channels; c++)
            residual[c * size + at] = std::clamp(
                s.plane.values[c * size + at] - bases.values[i * channels + c], -s.drift, s.drift);
    }
    if (!any) return;
    const Plane spread = {channels, s.plane.height, s.plane.width, residual.data(), beside.data()};
    if (rim) Diffusion().run(spread, done.data());
    for (size_t i = 0; i < bases.at.size(); i++) {
        const int64_t at = bases.at[i];
        if (s.known[at]) continue;
        s.known[at] = 1;
        for (int c = 0; c < channels; c++)
            s.plane.values[c * size + at] =
                std::clamp(bases.values[i * channels + c] + residual[c * size + at], 0, s.most);
    }
}

}  // namespace PXI_LEVEL
