// The synthesis of the pyramid, texture/synthesis.py; numpy is its judge, within rounding.
#pragma once

#include "laplace.h"
#include "lifting.h"
#include "linear.h"
#include "window.h"

namespace PXI_LEVEL {

struct Synthesis {  // of one level: weights [out][in].., as in texture/registered_model.py
    const float *linear, *first, *first_bias, *second, *second_bias, *third, *third_bias, *gain;
    int32_t hidden, height, width, rows, columns;  // rows is 2 height or 2 height - 1, and so on
    const float *low;                              // [height][width][3]
    const int32_t *latents;                        // [9][height][width]
    float *out;                                    // [rows][columns][3]
    int (*watch)(void *listener, int done, int all);  // as in struct Level
    void *listener;
};

// What planes give is summed at every position; latents, most of which are 0, add what they give to the
// positions around them.
class Synthesizer {
    typedef Linear<Real, 2> Hidden;
    typedef Linear<Real, LANES == 16 ? 1 : 2> Output;
    static constexpr int CELL = 12;  // samples of a position: 2 rows of 2 of 3 colours
    static constexpr int SPAN = 64;  // of five positions, with padding

    const Synthesis &s;
    const int h, w, width;  // hidden units with padding
    const int64_t size;
    Hidden first, second;
    Output third, linear;
    Rows<float> planes, wide;           // inputs of `first` and `linear`, [w + 2][3] and [w + 4][3]
    Rows<float> deep, details;          // what latents add to them, [w + 2][width] and [w + 8][CELL]
    Rows<float> rows;                   // of hidden units, [w + 2][width]
    std::vector<float> near, far;       // of what latents add, [9][3][3][width] and [9][5][SPAN]
    std::vector<float> between, cells;  // between both layers [w][width]; outputs [w]
    std::vector<float> sums;            // of the planes of three rows, [w + 2][3]
    std::vector<uint8_t> busy;          // [w + 4] whether a latent is not 0

    template <class L> static void put(float *to, typename L::Sums v, float least) {
        for (vec &x : v.v) x = x < least ? (vec){} + least : x;
        v.put(to);
    }
    template <class L> static typename L::Sums add(typename L::Sums v, const float *more) {
        const auto m = L::Sums::of(more);
        for (size_t i = 0; i < std::size(v.v); i++) v.v[i] += m.v[i];
        return v;
    }
    static float soft(float x) { return x / (1 + std::abs(x) * .125f); }
    // Adds a latent's part to n numbers, a multiple of LANES.
    static void spread(float value, const float *weights, int n, float *to) {
        typedef float part __attribute__((vector_size(4 * LANES), aligned(4), may_alias));
        for (int k = 0; k < n; k += LANES) *(part *)(to + k) += value * *(const part *)(weights + k);
    }

    // The next row of inputs of the network.
    void read(int y) {
        planes.up(), deep.up();
        float *to = planes[2];
        std::fill_n(to, (w + 2) * 3, 0.f), std::fill_n(deep[2], (w + 2) * width, 0.f);
        if (y >= h) return;
        const float *middle = s.low + (int64_t)y * w * 3, *up = y ? middle - w * 3 : middle,
                    *down = y + 1 < h ? middle + w * 3 : middle;
        float *column = sums.data() + 3;
        for (int k = 0; k < 3 * w; k++) column[k] = up[k] + middle[k] + down[k];
        std::copy_n(column, 3, column - 3), std::copy_n(column + 3 * w - 3, 3, column + 3 * w);
        for (int k = 0; k < 3 * w; k++)
            to[k + 3] = soft(middle[k] - (column[k - 3] + column[k] + column[k + 3]) / 9);
        const int32_t *latents = s.latents + (int64_t)y * w;
        find_busy(latents, size, 0, w, busy.data());
        for (int x = 0; x < w; x++)
            for (int c = 0; c < 9 && busy[x]; c++)
                if (const int32_t latent = latents[c * size + x])
                    for (int r = 0; r < 3; r++)
                        spread(soft((float)latent * s.gain[c]), near.data() + (3 * c + r) * 3 * width, 3 * width,
                               deep[r] + (int64_t)x * width);
    }

    // The next row of what the wavelet needs.
    void read_wide(int y) {
        wide.up(), details.up();
        std::fill_n(details[4], (w + 8) * CELL, 0.f);
        const int64_t lines[2] = {(int64_t)mirrored(y, s.rows, false) * w, (int64_t)mirrored(y, s.rows, true) * w};
        find_busy(s.latents, size, lines[0], w, busy.data() + 2);
        if (lines[1] != lines[0]) std::fill(busy.begin(), busy.end(), 1);
        for (int x : {-2, -1, w - 1, w, w + 1}) busy[x + 2] = 1;  // where mirroring depends on the band
        std::copy_n(s.low + 3 * lines[0], 3 * w, wide[4] + 6);
        for (int x : {-2, -1, w, w + 1})
            std::copy_n(s.low + 3 * (lines[0] + mirrored(x, s.columns, false)), 3, wide[4] + 3 * (x + 2));
        for (int x = -2; x < w + 2; x++) {
            if (!busy[x + 2]) continue;
            const int place[2] = {mirrored(x, s.columns, false), mirrored(x, s.columns, true)};
            for (int c = 0; c < 9; c++) {
                const int band = 1 + c % 3;
                const int32_t latent = s.latents[c * size + lines[band > 1] + place[band & 1]];
                for (int r = 0; r < 5 && latent; r++)
                    spread((float)latent * s.gain[c], far.data() + (5 * c + r) * SPAN, SPAN,
                           details[r] + (int64_t)(x + 2) * CELL);
            }
        }
    }

    // The next row of the hidden units.
    void hide(float *to) {
        first(w, [&](int x) { return planes[0] + 3 * x; }, [&](int x, int o, Hidden::Sums v) {
            const float *more = deep[0] + (int64_t)(x + 1) * width + o;
            put<Hidden>(between.data() + (int64_t)x * width + o, add<Hidden>(v, more), 0);
        });
        second(w, [&](int x) { return between.data() + (int64_t)x * width; }, [&](int x, int o, Hidden::Sums v) {
            put<Hidden>(to + (int64_t)(x + 1) * width + o, v, 0);
        });
    }

    void write(int y) {
        const int stride = linear.outputs();
        linear(w, [&](int x) { return wide[0] + 3 * x; }, [&](int x, int o, Output::Sums v) {
            add<Output>(v, details[0] + (int64_t)(x + 4) * CELL + o).put(cells.data() + (int64_t)x * stride + o);
        });
        third(w, [&](int x) { return rows[0] + (int64_t)x * width; }, [&](int x, int o, Output::Sums v) {
            float *to = cells.data() + (int64_t)x * stride + o;
            add<Output>(v, to).put(to);
        });
        for (int down = 0; down < 2 && 2 * y + down < s.rows; down++) {
            float *to = s.out + (int64_t)(2 * y + down) * s.columns * 3;
            const float *from = cells.data() + 6 * down;
            for (int x = 0; x < s.columns / 2; x++, from += stride, to += 6) std::memcpy(to, from, 6 * sizeof(float));
            if (s.columns % 2) std::copy_n(from, 3, to);
        }
    }

    // Where the weights have an output of a position: by colour.
    static int place(int output) { return 4 * (output % 3) + output / 3; }
    static std::vector<float> ordered(const float *bias) {
        std::vector<float> out(CELL);
        for (int o = 0; o < CELL; o++) out[o] = bias[place(o)];
        return out;
    }
    void set_weights() {
        for (int o = 0; o < s.hidden; o++) {
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < 12; i++) {
                    const float weight = s.first[(o * 12 + i) * 9 + tap];
                    if (i < 3)
                        first.set(3 * tap + i, o, weight);
                    else
                        near[((i - 3) * 9 + 8 - tap) * width + o] = weight;
                }
            for (int i = 0; i < s.hidden; i++) second.set(i, o, s.second[o * s.hidden + i]);
        }
        for (int o = 0; o < CELL; o++) {
            const int from = place(o);
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < s.hidden; i++)
                    third.set(width * tap + i, o, s.third[(from * s.hidden + i) * 9 + tap]);
            for (int tap = 0; tap < 25; tap++)
                for (int i = 0; i < 12; i++) {
                    const float weight = s.linear[(from * 12 + i) * 25 + tap];
                    const int c = 3 * (i % 3) + i / 3 - 1;  // of input 3 + 3 band + colour
                    if (i < 3)
                        linear.set(3 * tap + i, o, weight);
                    else
                        far[(c * 5 + 4 - tap / 5) * SPAN + (4 - tap % 5) * CELL + o] = weight;
                }
        }
    }

  public:
    explicit Synthesizer(const Synthesis &level)
        : s(level), h(s.height), w(s.width), width(Hidden::padded(s.hidden)), size((int64_t)h * w),
          first(square(3, 3, (w + 2) * 3), s.hidden, s.first_bias), second({{0, width}}, s.hidden, s.second_bias),
          third(square(3, width, (int64_t)(w + 2) * width), CELL, ordered(s.third_bias).data()), linear(square(5, 3, (w + 4) * 3), CELL, nullptr),
          planes(3, (w + 2) * 3), wide(5, (w + 4) * 3), deep(3, (int64_t)(w + 2) * width),
          details(5, (int64_t)(w + 9) * CELL), rows(3, (int64_t)(w + 2) * width), near(81 * width), far(45 * SPAN),
          between((size_t)w * width), cells((size_t)w * linear.outputs()), sums(3 * (w + 2)), busy(w + 4) {
        set_weights();
    }

    Wrong run() {
        read(0);
        for (int y = -2; y < 2; y++) read_wide(y);
        for (int y = 0; y <= h; y++) {  // the hidden units are a row ahead
            if (s.watch && y % 8 == 0 && s.watch(s.listener, y, h + 1)) return STOPPED;
            read(y + 1);
            rows.up();
            if (y < h)
                hide(rows[2]);
            else
                std::fill_n(rows[2], (w + 2) * width, 0.f);
            if (y == 0) continue;
            read_wide(y + 1);
            write(y - 1);
        }
        return NOTHING;
    }
};

}  // namespace PXI_LEVEL
