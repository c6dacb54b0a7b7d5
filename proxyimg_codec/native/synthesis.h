// The synthesis of the pyramid, texture/synthesis.py; numpy is its judge, within rounding.
#pragma once

#include "laplace.h"
#include "lifting.h"
#include "linear.h"

namespace PXI_LEVEL {

struct Synthesis {  // of one level: weights [out][in].., as in texture/registered_model.py
    const float *linear, *first, *first_bias, *second, *second_bias, *third, *third_bias, *gain;
    int32_t hidden, height, width, rows, columns;  // rows is 2 height or 2 height - 1, and so on
    const float *low;                              // [height][width][3]
    const int32_t *latents;                        // [9][height][width]
    float *out;                                    // [rows][columns][3]
    int (*watch)(int done, int all);               // as in struct Level
};

// Rows of 3 planes and 9 bands around a position. Where all the bands are 0, as in most windows of most
// pictures, the planes alone give the same sums.
struct Window {
    const int side, length;          // side rows of length positions
    std::vector<float> all, planes;  // [side][length][12], [side][length][3]
    std::vector<uint8_t> busy, any;  // [side][length] whether a band is not 0; [length] of any row
    std::vector<int32_t> loud, quiet;  // positions with such bands in their window, and the others

    Window(int side, int length)
        : side(side), length(length), all((size_t)side * length * 12), planes((size_t)side * length * 3),
          busy((size_t)side * length), any(length), loud(length), quiet(length) {}
    float *row(int r) { return all.data() + (int64_t)r * length * 12; }
    void up() {  // by one row
        std::copy(all.begin() + length * 12, all.end(), all.begin());
        std::copy(planes.begin() + length * 3, planes.end(), planes.begin());
        std::copy(busy.begin() + length, busy.end(), busy.begin());
    }
    void filled(int r) {  // a row of `all`, which the others follow
        const float *from = row(r);
        float *to = planes.data() + (int64_t)r * length * 3;
        for (int x = 0; x < length; x++, from += 12, to += 3) {
            std::copy_n(from, 3, to);
            uint64_t bands[5];  // as bits; one of the planes is passed over
            std::memcpy(bands, from + 2, sizeof bands);
            busy[(int64_t)r * length + x] = (bands[0] >> 32 | bands[1] | bands[2] | bands[3] | bands[4]) != 0;
        }
    }
    // Calls out(x, first output, Sums) of a layer of all, or of one of planes, for n positions.
    template <class L, class Out> void operator()(const L &of_all, const L &of_planes, int n, Out out) {
        std::fill(any.begin(), any.end(), 0);
        for (int r = 0; r < side; r++)
            for (int x = 0; x < length; x++) any[x] |= busy[(int64_t)r * length + x];
        int some = 0, none = 0;
        for (int x = 0; x < n; x++) {
            uint8_t near = 0;
            for (int k = 0; k < side; k++) near |= any[x + k];
            loud[some] = quiet[none] = x;
            some += near, none += !near;
        }
        of_all(some, [&](int i) { return all.data() + 12 * loud[i]; },
               [&](int i, int o, typename L::Sums v) { out(loud[i], o, v); });
        of_planes(none, [&](int i) { return planes.data() + 3 * quiet[i]; },
                  [&](int i, int o, typename L::Sums v) { out(quiet[i], o, v); });
    }
};

class Synthesizer {
    typedef Linear<Real, 2> Hidden;
    typedef Linear<Real, LANES == 16 ? 1 : 2> Output;

    const Synthesis &s;
    const int h, w, width;  // hidden units with padding
    const int64_t size, row;
    Hidden first, first_planes, second;
    Output third, linear, linear_planes;
    Window inputs, wide;  // of the network; as the wavelet needs them
    // Three rows of hidden units [w + 2][width]; between both layers [w][width]; outputs [w].
    std::vector<float> rows, between, cells;

    template <class L> static void put(float *to, typename L::Sums v, float least) {
        for (vec &x : v.v) x = x < least ? (vec){} + least : x;
        std::memcpy(to, &v, sizeof v);
    }
    static float soft(float x) { return x / (1 + std::abs(x) * .125f); }

    // The last row of inputs.
    void read(int y) {
        float *to = inputs.row(2);
        if (y >= h) {
            std::fill_n(to, (w + 2) * 12, 0.f);
            inputs.filled(2);
            return;
        }
        to += 12;
        const float *middle = s.low + (int64_t)y * w * 3, *up = y ? middle - w * 3 : middle,
                    *down = y + 1 < h ? middle + w * 3 : middle;
        for (int x = 0; x < w; x++)
            for (int c = 0; c < 3; c++) {
                const auto column = [&](int x) { return up[3 * x + c] + middle[3 * x + c] + down[3 * x + c]; };
                const float sum = column(std::max(x - 1, 0)) + column(x) + column(std::min(x + 1, w - 1));
                to[12 * x + c] = soft(middle[3 * x + c] - sum / 9);
            }
        for (int c = 0; c < 9; c++) {
            const int32_t *from = s.latents + c * size + (int64_t)y * w;
            for (int x = 0; x < w; x++) to[12 * x + 3 + c] = soft((float)from[x] * s.gain[c]);
        }
        inputs.filled(2);
    }

    // A row of planes: the low bands, then the high ones.
    void read_wide(int y, int r) {
        float *to = wide.row(r);
        const float *low = s.low + (int64_t)mirrored(y, s.rows, false) * w * 3;
        for (int x = -2; x < w + 2; x++)
            std::memcpy(to + 12 * (x + 2), low + 3 * mirrored(x, s.columns, false), 12);
        for (int c = 0; c < 9; c++) {
            const int band = 1 + c % 3, colour = c / 3;
            const bool down = band > 1, across = band & 1;
            const int32_t *from = s.latents + c * size + (int64_t)mirrored(y, s.rows, down) * w;
            float *out = to + 24 + 3 * band + colour;
            for (int x = 0; x < w; x++) out[12 * x] = (float)from[x] * s.gain[c];
            for (int x : {-2, -1, w - 1, w, w + 1})
                out[12 * x] = (float)from[mirrored(x, s.columns, across)] * s.gain[c];
        }
        wide.filled(r);
    }

    // Row y of the hidden units.
    void hide(float *to) {
        inputs(first, first_planes, w, [&](int x, int o, Hidden::Sums v) {
            put<Hidden>(between.data() + (int64_t)x * width + o, v, 0);
        });
        second(w, [&](int x) { return between.data() + (int64_t)x * width; }, [&](int x, int o, Hidden::Sums v) {
            put<Hidden>(to + (int64_t)(x + 1) * width + o, v, 0);
        });
    }

    void write(int y) {
        const int stride = linear.outputs();
        wide(linear, linear_planes, w, [&](int x, int o, Output::Sums v) {
            std::memcpy(cells.data() + (int64_t)x * stride + o, &v, sizeof v);
        });
        third(w, [&](int x) { return rows.data() + (int64_t)x * width; }, [&](int x, int o, Output::Sums v) {
            Output::Sums sum;
            float *to = cells.data() + (int64_t)x * stride + o;
            std::memcpy(&sum, to, sizeof sum);
            for (size_t i = 0; i < std::size(v.v); i++) sum.v[i] += v.v[i];
            std::memcpy(to, &sum, sizeof sum);
        });
        for (int down = 0; down < 2 && 2 * y + down < s.rows; down++) {
            float *to = s.out + (int64_t)(2 * y + down) * s.columns * 3;
            for (int x = 0; x < s.columns; x++)
                for (int colour = 0; colour < 3; colour++)
                    *to++ = cells[(int64_t)(x / 2) * stride + 4 * colour + 2 * down + x % 2];
        }
    }

  public:
    explicit Synthesizer(const Synthesis &level)
        : s(level), h(s.height), w(s.width), width(Hidden::padded(s.hidden)), size((int64_t)h * w),
          row((int64_t)(w + 2) * width), first(square(3, 12, (w + 2) * 12), s.hidden, s.first_bias),
          first_planes(square(3, 3, (w + 2) * 3), s.hidden, s.first_bias),
          second({{0, width}}, s.hidden, s.second_bias), third(square(3, width, row), 12, s.third_bias),
          linear(square(5, 12, (w + 4) * 12), 12, nullptr),
          linear_planes(square(5, 3, (w + 4) * 3), 12, nullptr), inputs(3, w + 2), wide(5, w + 4),
          rows(3 * row), between((size_t)w * width), cells((size_t)w * linear.outputs()) {
        for (int o = 0; o < s.hidden; o++) {
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < 12; i++) {
                    first.set(12 * tap + i, o, s.first[(o * 12 + i) * 9 + tap]);
                    if (i < 3) first_planes.set(3 * tap + i, o, s.first[(o * 12 + i) * 9 + tap]);
                }
            for (int i = 0; i < s.hidden; i++) second.set(i, o, s.second[o * s.hidden + i]);
        }
        for (int o = 0; o < 12; o++) {
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < s.hidden; i++)
                    third.set(width * tap + i, o, s.third[(o * s.hidden + i) * 9 + tap]);
            for (int tap = 0; tap < 25; tap++)
                for (int i = 0; i < 12; i++) {
                    linear.set(12 * tap + i, o, s.linear[(o * 12 + i) * 25 + tap]);
                    if (i < 3) linear_planes.set(3 * tap + i, o, s.linear[(o * 12 + i) * 25 + tap]);
                }
        }
    }

    Wrong run() {
        float *last = rows.data() + 2 * row;
        read(0);
        for (int r = 0; r < 4; r++) read_wide(r - 2, r + 1);
        for (int y = 0; y <= h; y++) {  // the hidden units are a row ahead
            if (s.watch && y % 8 == 0 && s.watch(y, h + 1)) return STOPPED;
            inputs.up();
            std::memmove(rows.data(), rows.data() + row, 2 * row * sizeof(float));
            read(y + 1);
            if (y < h)
                hide(last);
            else
                std::fill_n(last, row, 0.f);
            if (y == 0) continue;
            wide.up();
            read_wide(y + 1, 4);
            write(y - 1);
        }
        return NOTHING;
    }
};

}  // namespace PXI_LEVEL
