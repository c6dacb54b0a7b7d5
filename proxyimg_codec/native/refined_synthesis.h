// The synthesis of a level, forwards to the finer planes and back to slopes; the judge is
// encoder/pyramid/model.py, `Level.synthesise`, with what torch derives of it.
#pragma once

#include "refined_context.h"

namespace PXI_LEVEL {

struct SynthesisSums {
    Sum in, between, out, in_back, between_back, out_back, linear_back;  // out: of the network and the wavelet

    explicit SynthesisSums(const RefinedWeights &s) {
        const int n = s.hidden;
        in = ContextSums::forward({s.in, n, 12, 9}, s.in_bias), in_back = ContextSums::back({s.in, n, 12, 9});
        between = ContextSums::forward({s.between, n, n, 1}, s.between_bias);
        between_back = ContextSums::back({s.between, n, n, 1});
        out = Sum(12, n * 9 + 12 * 25, s.out_bias), out_back = ContextSums::back({s.out, 12, n, 9});
        out.set(0, s.out, n, 9), out.set(n * 9, s.linear, 12, 25);
        linear_back = ContextSums::back({s.linear, 12, 12, 25});
    }
};

// Channel of a band among the inputs of the wavelet: bands of all colours, one after the other.
static inline int wide_at(int channel) { return 3 + 3 * (channel % 3) + channel / 3; }
static inline bool is_high(int band, bool across) { return across ? band != 1 : band != 0; }

// Samples of the finest planes, as the cells that a synthesis gives: what is asked for, and its weight,
// which is 0 beyond the picture.
struct Wanted {
    Floats picture, weight;  // [12], [4]
    float colour[9], step;
};

class SynthesisForward {
    RefinedLevel &s;
    const SynthesisSums &sums;
    const int n, w;
    Floats inputs, first, second, wide, out;
    Terms in;

    void read(int y) {
        if (y < 0 || y >= s.h) return inputs.clear(y);
        for (int c = 0; c < 3; c++) {
            float *to = inputs(y, c);
            high_pass(s.low, c, y, s.h, to);
            for (int x = 0; x < w; x += LANES) store(to + x, bounded(load(to + x), 8));
        }
        for (int c = 0; c < 9; c++)
            for (int x = 0; x < w; x += LANES)
                store(inputs(y, 3 + c) + x, bounded(load(s.latents(y, c) + x) * s.weights.gain[c], 8));
        inputs.trim(y);
    }
    // Row y of all bands, mirrored beyond the edges as the wavelet needs it.
    void extend(int y) {
        for (int k = 0; k < 12; k++) {
            const int c = k < 3 ? k : 3 * ((k - 3) % 3) + (k - 3) / 3, band = c % 3;
            const bool down = k >= 3 && is_high(band, false), across = k >= 3 && is_high(band, true);
            const float gain = k < 3 ? 1 : s.weights.gain[c];
            const int row = mirrored(y, s.rows, down);
            const float *from = k < 3 ? s.low(row, k) : s.latents(row, c);
            float *to = wide(y, k);
            for (int x = 0; x < w; x += LANES) store(to + x, load(from + x) * gain);
            for (int x : {-2, -1, w - 1, w, w + 1}) to[x] = from[mirrored(x, s.columns, across)] * gain;
        }
    }
    static auto positive(Floats &to, Passed &passed, int y, int row) {
        passed.words.clear(y);
        return [&to, &passed, y, row](int o, int x, vec v) {
            passed.mark(y, o, x, v > 0.f);
            store(to(row, o) + x, most(v, (vec){}));
        };
    }
    void hide(int y) {
        if (y < 0 || y >= s.h) return second.clear(y);
        in.clear();
        square_terms(in, inputs, 0, 12, y, 1);
        const int all_terms = sums.in.terms;
        sums.in(in.data(), w, [&](int x, int end) { return near(y, 1, x, end) ? all_terms : 3 * 9; },
                positive(first, s.in, y, 0));
        in.clear(), row_terms(in, first, 0, 0, n);
        sums.between(in.data(), w, positive(second, s.between, y, y));
        second.trim(y);
    }
    void show(int y) {
        in.clear();
        square_terms(in, second, 0, n, y, 1);
        square_terms(in, wide, 0, 12, y, 2);
        const int all_terms = sums.out.terms, few = n * 9 + 3 * 25;
        sums.out(in.data(), w, [&](int x, int end) { return near(y, 2, x, end) ? all_terms : few; },
                 [&](int o, int x, vec v) { store(out(0, o) + x, v); });
    }
    // Whether a latent within `reach` of positions x .. end - 1 of row y is not 0.
    bool near(int y, int reach, int x, int end) const {
        if (y < reach || y + reach >= s.h || x < reach || end + reach > w) return true;  // what is mirrored is seen too
        uint8_t any = 0;
        for (int r = y - reach; r <= y + reach; r++)
            for (int k = x - reach; k < end + reach; k++) any |= s.busy(r)[k];
        return any;
    }
    void spread(int y, Floats &finer) const {
        for (int c = 0; c < 3; c++)
            for (int down = 0; down < 2 && 2 * y + down < s.rows; down++) {
                float *to = finer(2 * y + down, c);
                const float *even = out(0, 4 * c + 2 * down), *odd = out(0, 4 * c + 2 * down + 1);
                for (int x = 0; x < s.columns; x++) to[x] = x % 2 ? odd[x / 2] : even[x / 2];
            }
    }
    // Weighted squared error of a row in squares of the step; its slopes become those of the cells. What is
    // beyond 0..255 is shown as these bounds.
    double compare(int y, const Wanted &wanted) {
        vec total = {};
        const float *m = wanted.colour;
        for (int x = 0; x < w; x += LANES)
            for (int k = 0; k < 4; k++) {
                const vec weight = load(wanted.weight(y, k) + x);
                vec slopes[3] = {};
                for (int i = 0; i < 3; i++) {
                    vec shown = all(128 / wanted.step);
                    for (int c = 0; c < 3; c++) shown += load(out(0, 4 * c + k) + x) * m[3 * i + c];
                    shown = most(least(shown, all(255 / wanted.step)), (vec){});
                    const vec off = shown - load(wanted.picture(y, 4 * i + k) + x);
                    total += weight * off * off;
                    for (int c = 0; c < 3; c++) slopes[c] += 2.f * weight * off * m[3 * i + c];
                }
                for (int c = 0; c < 3; c++) store(s.cells(y, 4 * c + k) + x, slopes[c]);
            }
        s.cells.trim(y);
        return added(total);
    }

  public:
    SynthesisForward(RefinedLevel &level, const SynthesisSums &sums)
        : s(level), sums(sums), n(level.weights.hidden), w(level.w), inputs(12, w, 3), first(n, w, 1), second(n, w, 3),
          wide(12, w, 5), out(12, w, 1) {}

    // Rows from .. to - 1: makes finer planes, or at the finest level compares.
    void run(int from, int to, Floats *finer, const Wanted &wanted, double *errors) {
        for (int t = from - 2; t < to + 2; t++) {
            read(t), extend(t);
            if (t - 1 >= from - 1) hide(t - 1);
            if (t - 2 < from) continue;
            show(t - 2);
            if (finer)
                spread(t - 2, *finer);
            else
                errors[t - 2] = compare(t - 2, wanted);
        }
    }
};

class SynthesisBackward {
    RefinedLevel &s;
    const SynthesisSums &sums;
    const int n, w;
    Floats second, first, inputs;
    const Floats none;  // a row of zeros
    Terms in;

    const float *cells(int y, int c) const { return y < 0 || y >= s.h ? none(0) : s.cells(y, c); }
    void hide(int y) {
        if (y < 0 || y >= s.h) return first.clear(y);
        in.clear();
        for (int o = 0; o < 12; o++)
            for (int tap = 0; tap < 9; tap++) in.push_back(cells(y + 1 - tap / 3, o) + 1 - tap % 3);
        sums.out_back(in.data(), w, [&](int o, int x, vec v) { store(second(0, o) + x, s.between.of(y, o, x, v)); });
        in.clear(), row_terms(in, second, 0, 0, n);
        sums.between_back(in.data(), w, [&](int o, int x, vec v) { store(first(y, o) + x, s.in.of(y, o, x, v)); });
        first.trim(y);
    }
    void to_inputs(int y) {
        in.clear(), square_terms(in, first, 0, n, y, 1, -1);
        sums.in_back(in.data(), w, [&](int o, int x, vec v) { store(inputs(0, o) + x, v); });
        for (int c = 0; c < 3; c++) {
            float *to = s.by_inputs[1](y, c);
            high_pass(s.low, c, y, s.h, to);
            for (int x = 0; x < w; x += LANES)
                store(to + x, load(inputs(0, c) + x) * by_bounded(load(to + x), 8));
        }
        s.by_inputs[1].trim(y);
        for (int c = 0; c < 9; c++) {
            const float gain = s.weights.gain[c];
            float *to = s.by_latents(y, c);
            for (int x = 0; x < w; x += LANES)
                store(to + x, load(to + x) + load(inputs(0, 3 + c) + x) * gain *
                                                 by_bounded(load(s.latents(y, c) + x) * gain, 8));
        }
    }
    // Row y of what the wavelet filters, which has two positions more on each side; so has the row itself.
    void to_wide(int y) {
        in.clear();
        for (int o = 0; o < 12; o++)
            for (int tap = 0; tap < 25; tap++) in.push_back(cells(y + 2 - tap / 5, o) - tap % 5);
        sums.linear_back(in.data(), w + 4, [&](int o, int x, vec v) { store(s.by_wide(y + 2, o) + x, v); });
    }

  public:
    SynthesisBackward(RefinedLevel &level, const SynthesisSums &sums)
        : s(level), sums(sums), n(level.weights.hidden), w(level.w), second(n, w, 1), first(n, w, 3), inputs(12, w, 1),
          none(1, w + 8, 1) {}

    void run(int from, int to) {
        for (int t = from - 1; t < to + 1; t++) {
            hide(t);
            if (t - 1 >= from) to_inputs(t - 1);
        }
        for (int y = from ? from : -2; y < (to == s.h ? to + 2 : to); y++) to_wide(y);
    }

    // Rows from .. to - 1 of what all rows of `by_wide` give, folded where it was mirrored.
    void fold(int from, int to) {
        for (int y = from; y < to; y++)
            for (int k = 0; k < 12; k++) {
                const int c = k < 3 ? k : 3 * ((k - 3) % 3) + (k - 3) / 3, band = c % 3;
                const bool down = k >= 3 && is_high(band, false), across = k >= 3 && is_high(band, true);
                const float gain = k < 3 ? 1 : s.weights.gain[c];
                float *out = k < 3 ? s.by_low(y, k) : s.by_latents(y, c);
                if (k < 3) std::fill_n(out, w, 0.f);
                const int rows[] = {y, -2, -1, s.h, s.h + 1, s.h - 1};  // those that are mirrored lie at the edges
                for (int i = 0; i < (y == s.h - 1 ? 5 : 6); i++) {
                    const int r = rows[i];
                    if (mirrored(r, s.rows, down) != y) continue;
                    const float *row = s.by_wide(r + 2, k) + 2;
                    for (int x = 0; x < w - 1; x++) out[x] += row[x] * gain;
                    for (int x : {-2, -1, w - 1, w, w + 1}) out[mirrored(x, s.columns, across)] += row[x] * gain;
                }
            }
        Floats &spread = s.by_inputs[1];
        std::vector<float> row(w);
        for (int y = from; y < to; y++)
            for (int c = 0; c < 3; c++) {
                high_pass(spread, c, y, s.h, row.data());
                for (int x = 0; x < w; x++) s.by_low(y, c)[x] += row[x];
            }
    }
};

}  // namespace PXI_LEVEL
