// The synthesis of the pyramid, texture/synthesis.py; numpy is its judge, within rounding.
#pragma once

#include "linear.h"

namespace PXI_LEVEL {

struct Synthesis {  // of one level: weights [out][in].., as in texture/registered_model.py
    const float *linear, *first, *first_bias, *second, *second_bias, *third, *third_bias, *gain;
    int32_t hidden, height, width, rows, columns;  // rows is 2 height or 2 height - 1, and so on
    const float *low;                              // [height][width][3]
    const int32_t *latents;                        // [9][height][width]
    float *out;                                    // [rows][columns][3]
};

class Synthesizer {
    typedef Linear<Real, 2> Hidden;
    typedef Linear<Real, LANES == 16 ? 1 : 2> Output;

    const Synthesis &s;
    const int h, w, width;  // hidden units with padding
    const int64_t size, in_row, row, wide_row;
    Hidden first, second;
    Output third, linear;
    // Three rows of inputs [w + 2][12], three of hidden units [w + 2][width], five of planes as the
    // wavelet needs them [w + 4][12]; between both layers [w][width]; outputs [w].
    std::vector<float> inputs, rows, wide, between, cells;

    template <class L> static void put(float *to, typename L::Sums v, float least) {
        for (vec &x : v.v) x = x < least ? (vec){} + least : x;
        std::memcpy(to, &v, sizeof v);
    }
    static float soft(float x) { return x / (1 + std::abs(x) * .125f); }

    // Index into a band of a line of `size` samples, mirrored about the first and the last of them.
    static int mirrored(int i, int size, bool high) {
        const int count = (size + 1 - high) / 2;
        if (i < 0) i = -i - high;
        if (i >= count) i = size - 1 - high - i;
        return std::clamp(i, 0, std::max(count - 1, 0));
    }

    // A row of inputs.
    void read(int y, float *to) const {
        if (y >= h) {
            std::fill_n(to, in_row, 0.f);
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
    }

    // A row of planes: the low bands, then the high ones.
    void read_wide(int y, float *to) const {
        const float *low = s.low + (int64_t)mirrored(y, s.rows, false) * w * 3;
        for (int x = -2; x < w + 2; x++)
            std::memcpy(to + 12 * (x + 2), low + 3 * mirrored(x, s.columns, false), 12);
        for (int c = 0; c < 9; c++) {
            const int band = 1 + c % 3, colour = c / 3;
            const bool down = band > 1, across = band & 1;
            const int32_t *from = s.latents + c * size + (int64_t)mirrored(y, s.rows, down) * w;
            for (int x = -2; x < w + 2; x++)
                to[12 * (x + 2) + 3 * band + colour] = (float)from[mirrored(x, s.columns, across)] * s.gain[c];
        }
    }

    // Row y of the hidden units.
    void hide(float *to) {
        first(w, [&](int x) { return inputs.data() + 12 * x; }, [&](int x, int o, Hidden::Sums v) {
            put<Hidden>(between.data() + (int64_t)x * width + o, v, 0);
        });
        second(w, [&](int x) { return between.data() + (int64_t)x * width; }, [&](int x, int o, Hidden::Sums v) {
            put<Hidden>(to + (int64_t)(x + 1) * width + o, v, 0);
        });
    }

    void write(int y) {
        const int stride = linear.outputs();
        linear(w, [&](int x) { return wide.data() + 12 * x; }, [&](int x, int o, Output::Sums v) {
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
          in_row((w + 2) * 12), row((int64_t)(w + 2) * width), wide_row((w + 4) * 12),
          first(square(3, 12, in_row), s.hidden, s.first_bias), second({{0, width}}, s.hidden, s.second_bias),
          third(square(3, width, row), 12, s.third_bias), linear(square(5, 12, wide_row), 12, nullptr),
          inputs(3 * in_row), rows(3 * row), wide(5 * wide_row), between((size_t)w * width),
          cells((size_t)w * linear.outputs()) {
        for (int o = 0; o < s.hidden; o++) {
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < 12; i++) first.set(12 * tap + i, o, s.first[(o * 12 + i) * 9 + tap]);
            for (int i = 0; i < s.hidden; i++) second.set(i, o, s.second[o * s.hidden + i]);
        }
        for (int o = 0; o < 12; o++) {
            for (int tap = 0; tap < 9; tap++)
                for (int i = 0; i < s.hidden; i++)
                    third.set(width * tap + i, o, s.third[(o * s.hidden + i) * 9 + tap]);
            for (int tap = 0; tap < 25; tap++)
                for (int i = 0; i < 12; i++) linear.set(12 * tap + i, o, s.linear[(o * 12 + i) * 25 + tap]);
        }
    }

    void run() {
        float *last_in = inputs.data() + 2 * in_row, *last = rows.data() + 2 * row;
        read(0, last_in);
        for (int r = 0; r < 4; r++) read_wide(r - 2, wide.data() + (r + 1) * wide_row);
        for (int y = 0; y <= h; y++) {  // the hidden units are a row ahead
            std::memmove(inputs.data(), inputs.data() + in_row, 2 * in_row * sizeof(float));
            std::memmove(rows.data(), rows.data() + row, 2 * row * sizeof(float));
            read(y + 1, last_in);
            if (y < h)
                hide(last);
            else
                std::fill_n(last, row, 0.f);
            if (y == 0) continue;
            std::memmove(wide.data(), wide.data() + wide_row, 4 * wide_row * sizeof(float));
            read_wide(y + 1, wide.data() + 4 * wide_row);
            write(y - 1);
        }
    }
};

}  // namespace PXI_LEVEL
