// The synthesis of the pyramid, texture/synthesis.py; numpy is its judge, within rounding.
#pragma once

#include <cstring>

#include "laplace.h"
#include "lifting.h"
#include "sums.h"
#include "window.h"

namespace PXI_LEVEL {

struct Synthesis {  // of one level, or a part of it: weights [out][in].., as in texture/registered_model.py
    const float *linear, *first, *first_bias, *second, *second_bias, *third, *third_bias, *gain;
    int32_t hidden, height, width, rows, columns;  // rows is 2 height or 2 height - 1, and so on
    const float *low;                              // [height][width][3]
    const int32_t *latents;                        // [9][height][width]
    const float *colours;                          // [3][3] as for `shown`, to put samples; or null, to put planes
    float *out;                                    // [bottom - top][right - left][3], of the finer planes
    int64_t low_line, line, band, out_line;        // numbers from a row, or a band, to the next one
    int32_t top, bottom, left, right;              // rows and columns that are made
    int (*watch)(void *listener, int done, int all);  // as in struct Level
    void *listener;
};

// What planes give is summed at every position; latents, most of which are 0, add what they give to the
// positions around them. Rows of planes and of hidden units hold one after the other, so that vectors run
// along positions.
class Synthesizer {
    static constexpr int CELL = 12;  // samples of a position: 2 rows of 2 of 3 colours
    static constexpr int SPAN = 64;  // of five positions, with padding
    static constexpr int WIDE = 2, RUN = WIDE * LANES;  // vectors of positions, and positions, at a time

    template <int OUTS> struct Listed {
        const float *const *list, *weights;
        Term operator()(int k) const { return {list[k], weights + k * OUTS}; }
    };
    // A layer of `outputs`, OUTS at a time: weights [outputs / OUTS][terms][OUTS] and biases [outputs].
    template <int OUTS> struct Summed {
        const int terms;
        std::vector<float> weights, bias;
        Summed(int terms, int outputs) : terms(terms), weights((size_t)terms * outputs), bias(outputs) {}
        float &at(int term, int output) { return weights[(output / OUTS * terms + term) * OUTS + output % OUTS]; }
        // Calls out(o, j, vec) with the sums for outputs and vectors of positions from x on.
        template <class Out> void operator()(const std::vector<const float *> &from, int x, Out out) const {
            for (int o = 0; o < (int)bias.size(); o += OUTS) {
                vec found[OUTS * WIDE];
                add_terms<OUTS, WIDE>(Listed<OUTS>{from.data(), &weights[(size_t)o * terms]}, terms, x, &bias[o], found);
                for (int k = 0; k < OUTS; k++)
                    for (int j = 0; j < WIDE; j++) out(o + k, j, found[k * WIDE + j]);
            }
        }
    };
    struct Part {  // what a latent adds
        float value;
        const float *weights;
    };

    const Synthesis &s;
    const int h, w, width;              // hidden units with padding
    const int x0, x1, y0, y1;           // positions whose samples are made
    const int filled, pitch;            // positions of a row of at least a run, and with room beside them
    Rows<float> planes, wide;           // inputs of `first` and `linear`, [3][3][pitch] and [5][3][pitch]
    Rows<float> deep, details;          // what latents add to them, [filled + 2][width] and [w + 8][CELL]
    Rows<float> rows;                   // of hidden units, [3][width][pitch]
    Rows<uint8_t> busy, coded;          // whether a latent is not 0, [3][filled + 2] and [5][filled + 4]
    std::vector<float> near, far;       // of what latents add, [9][3][3][width] and [9][5][SPAN]
    Summed<4> first, second;
    Summed<CELL / 2> third, linear;
    std::vector<float> between, cells;  // between both layers [width][RUN], and samples [CELL][RUN]
    std::vector<float> more;            // what latents add to these, [outputs][RUN]
    std::vector<float> sums;            // of the planes of three rows, [w + 2][3]
    std::vector<Part> parts;            // of the latents of a position
    std::vector<const float *> inputs, hidden, units;  // of `first` or `linear`, of `second`, and of `third`

    static float soft(float x) { return x / (1 + std::abs(x) * .125f); }
    // Adds the parts of a position's latents to n numbers, a multiple of LANES, V vectors at a time.
    template <int V = 4> static void spread(const std::vector<Part> &parts, int64_t start, int n, float *to) {
        int k = 0;
        for (; k + V * LANES <= n; k += V * LANES) {
            vec sums[V];
#pragma GCC unroll 4
            for (int j = 0; j < V; j++) sums[j] = load(to + k + j * LANES);
            for (const Part &part : parts) {
                const float *weights = part.weights + start + k;
#pragma GCC unroll 4
                for (int j = 0; j < V; j++) sums[j] += part.value * load(weights + j * LANES);
            }
#pragma GCC unroll 4
            for (int j = 0; j < V; j++) store(to + k + j * LANES, sums[j]);
        }
        if constexpr (V > 1)
            if (k < n) spread<1>(parts, start + k, n - k, to + k);
    }
    // Where side x side neighbours lie in rows of planes.
    void around(Rows<float> &from, int side, int count, std::vector<const float *> &to) const {
        to.clear();
        for (int tap = 0; tap < side * side; tap++)
            for (int c = 0; c < count; c++)
                to.push_back(from[tap / side] + (int64_t)c * pitch + LANES + tap % side - side / 2);
    }
    // What latents add to n outputs of the positions from x on: to `more` [n][RUN]; or null, if it is nothing.
    // `any` tells in which positions there are latents, of `side` rows and from side / 2 before the first one.
    const float *added(Rows<uint8_t> &any, int side, const float *from, int n, int x) {
        uint8_t some = 0;
        for (int r = 0; r < side; r++)
            for (int k = 0; k < RUN + side - 1; k++) some |= any[r][x + k];
        if (!some) return nullptr;
        for (int k = 0; k < RUN; k++, from += n)
            for (int o = 0; o < n; o++) more[o * RUN + k] = from[o];
        return more.data();
    }

    // The next row of inputs of the network.
    void read(int y) {
        planes.up(), deep.up(), busy.up();
        float *to = planes[2] + LANES;
        uint8_t *some = busy[2] + 1;
        std::fill_n(deep[2], (w + 2) * width, 0.f);
        if (y >= h) {
            std::fill_n(planes[2], 3 * pitch, 0.f), std::fill_n(some, w, (uint8_t)0);
            return;
        }
        const float *middle = s.low + y * s.low_line, *up = y ? middle - s.low_line : middle,
                    *down = y + 1 < h ? middle + s.low_line : middle;
        float *column = sums.data() + 3;
        for (int k = 0; k < 3 * w; k++) column[k] = up[k] + middle[k] + down[k];
        std::copy_n(column, 3, column - 3), std::copy_n(column + 3 * w - 3, 3, column + 3 * w);
        for (int c = 0; c < 3; c++)
            for (int x = 0, k = c; x < w; x++, k += 3)
                to[c * pitch + x] = soft(middle[k] - (column[k - 3] + column[k] + column[k + 3]) / 9);
        const int32_t *latents = s.latents + y * s.line;
        find_busy(latents, s.band, 0, w, some);
        for (int x = std::max(x0 - 2, 0); x < std::min(x1 + 2, w); x++) {
            if (!some[x]) continue;
            parts.clear();
            for (int c = 0; c < 9; c++)
                if (const int32_t latent = latents[c * s.band + x])
                    parts.push_back({soft((float)latent * s.gain[c]), &near[c * 9 * width]});
            for (int r = 0; r < 3; r++) spread(parts, r * 3 * width, 3 * width, deep[r] + (int64_t)x * width);
        }
    }

    // The next row of what the wavelet needs.
    void read_wide(int y) {
        wide.up(), details.up(), coded.up();
        std::fill_n(details[4], (w + 8) * CELL, 0.f);
        const int64_t lines[2] = {mirrored(y, s.rows, false), mirrored(y, s.rows, true)};
        uint8_t *some = coded[4] + 2;
        find_busy(s.latents, s.band, lines[0] * s.line, w, some);
        if (lines[1] != lines[0]) std::fill_n(some, w, (uint8_t)1);
        for (int x : {-2, -1, w - 1, w, w + 1}) some[x] = 1;  // where mirroring depends on the band
        const float *low = s.low + lines[0] * s.low_line;
        float *to = wide[4] + LANES;
        for (int c = 0; c < 3; c++) {
            for (int x = 0; x < w; x++) to[c * pitch + x] = low[3 * x + c];
            for (int x : {-2, -1, w, w + 1}) to[c * pitch + x] = low[3 * mirrored(x, s.columns, false) + c];
        }
        for (int x = x0 - 2; x < x1 + 2; x++) {
            if (!some[x]) continue;
            const int place[2] = {mirrored(x, s.columns, false), mirrored(x, s.columns, true)};
            parts.clear();
            for (int c = 0; c < 9; c++) {
                const int band = 1 + c % 3;
                if (const int32_t latent = s.latents[c * s.band + lines[band > 1] * s.line + place[band & 1]])
                    parts.push_back({(float)latent * s.gain[c], &far[c * 5 * SPAN]});
            }
            for (int r = 0; r < 5 && !parts.empty(); r++)
                spread(parts, r * SPAN, SPAN, details[r] + (int64_t)(x + 2) * CELL);
        }
    }

    // The next row of the hidden units.
    void hide() {
        float *to = rows[2] + LANES;
        around(planes, 3, 3, inputs);
        const int end = std::min(x1 + 1, w);
        for (int at = std::max(x0 - 1, 0); at < end; at += RUN) {
            const int x = std::min(at, filled - RUN);
            const float *extra = added(busy, 3, deep[0] + (int64_t)(x + 1) * width, width, x);
            first(inputs, x, [&](int o, int j, vec v) {
                if (extra) v += load(extra + o * RUN + j * LANES);
                store(&between[o * RUN + j * LANES], v < 0 ? (vec){} : v);
            });
            second(hidden, 0, [&](int o, int j, vec v) {
                store(to + (int64_t)o * pitch + x + j * LANES, v < 0 ? (vec){} : v);
            });
        }
        for (int o = 0; o < width; o++) to[(int64_t)o * pitch + w] = 0;  // what is outside counts as 0
    }

    void write(int y) {
        around(wide, 5, 3, inputs);
        around(rows, 3, width, units);
        for (int at = x0; at < x1; at += RUN) {
            const int x = std::min(at, filled - RUN);
            const float *extra = added(coded, 5, details[0] + (int64_t)(x + 4) * CELL, CELL, x);
            linear(inputs, x, [&](int o, int j, vec v) {
                if (extra) v += load(extra + o * RUN + j * LANES);
                store(&cells[o * RUN + j * LANES], v);
            });
            third(units, x, [&](int o, int j, vec v) {
                float *cell = &cells[o * RUN + j * LANES];
                store(cell, v + load(cell));
            });
            if (s.colours)
                for (int k = 0; k < 4 * RUN; k += LANES) show(&cells[k / RUN * 3 * RUN + k % RUN]);
            for (int row = std::max(2 * y, s.top); row < std::min(2 * y + 2, s.bottom); row++)
                put(s.out + (row - s.top) * s.out_line, &cells[row % 2 * 6 * RUN], x, at, std::min(at + RUN, x1));
        }
    }
    // Turns planes, RUN numbers apart, to samples in 0..1, as `shown` does.
    void show(float *planes) const {
        const vec from[3] = {load(planes), load(planes + RUN), load(planes + 2 * RUN)};
        for (int c = 0; c < 3; c++) {
            const float *weight = s.colours + 3 * c;
            const vec v = (from[0] * weight[0] + from[1] * weight[1] + from[2] * weight[2] + 128) / 255;
            store(planes + c * RUN, v < 0 ? (vec){} : v > 1 ? all(1) : v);
        }
    }
    // Puts the samples of a row at positions from .. end - 1; those of `cell` begin at `start`.
    void put(float *row, const float *cell, int start, int from, int end) const {
        for (int x = from; x < end; x++) {
            const float *own = cell + x - start;
            const int first = std::max(2 * x, s.left), last = std::min(2 * x + 2, s.right);
            float *to = row + 3 * (first - s.left);
            if (last - first == 2)
                for (int k = 0; k < 6; k++) to[k] = own[k * RUN];
            else
                for (int k = 0; k < 3; k++) to[k] = own[(first % 2 * 3 + k) * RUN];
        }
    }

    // Where the weights have an output of a position: by colour.
    static int place(int output) { return 4 * (output % 3) + output / 3; }
    void set_weights() {
        std::copy_n(s.first_bias, s.hidden, first.bias.begin()), std::copy_n(s.second_bias, s.hidden, second.bias.begin());
        for (int o = 0; o < s.hidden; o++) {
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < 12; i++) {
                    const float weight = s.first[(o * 12 + i) * 9 + tap];
                    if (i < 3)
                        first.at(3 * tap + i, o) = weight;
                    else
                        near[((i - 3) * 9 + 8 - tap) * width + o] = weight;
                }
            for (int i = 0; i < s.hidden; i++) second.at(i, o) = s.second[o * s.hidden + i];
        }
        for (int o = 0; o < CELL; o++) {
            const int from = place(o);
            third.bias[o] = s.third_bias[from];
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < s.hidden; i++)
                    third.at(width * tap + i, o) = s.third[(from * s.hidden + i) * 9 + tap];
            for (int tap = 0; tap < 25; tap++)
                for (int i = 0; i < 12; i++) {
                    const float weight = s.linear[(from * 12 + i) * 25 + tap];
                    const int c = 3 * (i % 3) + i / 3 - 1;  // of input 3 + 3 band + colour
                    if (i < 3)
                        linear.at(3 * tap + i, o) = weight;
                    else
                        far[(c * 5 + 4 - tap / 5) * SPAN + (4 - tap % 5) * CELL + o] = weight;
                }
        }
        for (int i = 0; i < width; i++) hidden.push_back(&between[i * RUN]);
    }

  public:
    explicit Synthesizer(const Synthesis &level)
        : s(level), h(s.height), w(s.width), width((s.hidden + LANES - 1) / LANES * LANES), x0(s.left / 2),
          x1((s.right + 1) / 2), y0(s.top / 2), y1((s.bottom + 1) / 2), filled(std::max(w, RUN)), pitch(filled + 2 * LANES),
          planes(3, 3 * pitch), wide(5, 3 * pitch), deep(3, (int64_t)(filled + 2) * width),
          details(5, (int64_t)(filled + 9) * CELL), rows(3, (int64_t)width * pitch), busy(3, filled + 2), coded(5, filled + 4),
          near(81 * width), far(45 * SPAN), first(27, width), second(width, width), third(9 * width, CELL), linear(75, CELL),
          between(width * RUN),
          cells(CELL * RUN), more(std::max(width, CELL) * RUN), sums(3 * (w + 2)) {
        set_weights();
    }

    Wrong run() {
        const int begin = std::max(y0 - 1, 0);
        for (int y = std::max(begin - 1, 0); y <= begin; y++) read(y);
        for (int y = y0 - 2; y < y0 + 2; y++) read_wide(y);
        for (int y = begin; y <= y1; y++) {  // the hidden units are a row ahead
            if (s.watch && y % 8 == 0 && s.watch(s.listener, y - begin, y1 - begin + 1)) return STOPPED;
            read(y + 1);
            rows.up();
            if (y < h)
                hide();
            else
                std::fill_n(rows[2], (int64_t)width * pitch, 0.f);
            if (y <= y0) continue;
            read_wide(y + 1);
            write(y - 1);
        }
        return NOTHING;
    }
};

}  // namespace PXI_LEVEL
