// The context network of a level, forwards to the bits of its latents and back to the slopes of the cost;
// the judge is encoder/pyramid/model.py, `Level.likelihood`, with what torch derives of it.
#pragma once

#include "refined_level.h"

namespace PXI_LEVEL {

struct ContextSums {  // the layers, and the transposes that the gradient goes back through
    Sum first, second, mix, luma, from_luma, chroma;
    Sum first_back, second_back, causal_back, mix_back, luma_back, from_luma_back, chroma_back;

    explicit ContextSums(const RefinedWeights &s) {
        const int n = s.context;
        first = forward({s.first, n, 12, 9}, s.first_bias), first_back = back({s.first, n, 12, 9});
        second = Sum(n, n * 9 + 18 * CAUSAL, s.second_bias), second_back = back({s.second, n, n, 9});
        second.set(0, s.second, n, 9), second.set(n * 9, s.causal, 18, CAUSAL);
        causal_back = back({s.causal, n, 18, CAUSAL});
        mix = forward({s.mix, n, n, 1}, s.mix_bias), mix_back = back({s.mix, n, n, 1});
        luma = forward({s.luma, 6, n, 1}, s.luma_bias), luma_back = back({s.luma, 6, n, 1});
        from_luma = forward({s.from_luma, n, 6, 1}, s.from_luma_bias), from_luma_back = back({s.from_luma, n, 6, 1});
        chroma = forward({s.chroma, 12, n, 1}, s.chroma_bias), chroma_back = back({s.chroma, 12, n, 1});
    }
    static Sum forward(const Kernel &k, const float *bias) {
        Sum out(k.outputs, k.inputs * k.taps, bias);
        out.set(0, k.weights, k.inputs, k.taps);
        return out;
    }
    static Sum back(const Kernel &k) {
        Sum out(k.inputs, k.outputs * k.taps);
        out.set(0, k.transposed().data(), k.outputs, k.taps);
        return out;
    }
};

// Output of the heads: means of luma, log scales of luma, means of chroma, log scales of chroma.
static inline int mean_at(int channel) { return channel < 3 ? channel : channel + 3; }
static inline int scale_at(int channel) { return channel < 3 ? channel + 3 : channel + 9; }

typedef std::vector<const float *> Terms;

static inline void row_terms(Terms &in, const Floats &rows, int y, int from, int to) {
    for (int c = from; c < to; c++) in.push_back(rows(y, c));
}

class ContextForward {
    RefinedLevel &s;
    const ContextSums &sums;
    const RefinedLevel *parent;  // the next coarser level, or null
    const float price;
    const int n, w;
    Floats inputs, once, seen, twice, mixed, toned, out;
    Terms in;

    void read(int y) {  // the inputs of a row
        if (y < 0 || y >= s.h) return inputs.clear(y);
        for (int c = 0; c < 3; c++) {
            float *to = inputs(y, c);
            high_pass(s.plain, c, y, s.h, to);
            for (int x = 0; x < w; x += LANES) store(to + x, bounded(load(to + x), 4));
        }
        for (int c = 0; parent && c < 9; c++) {
            const float *from = parent->latents(y / 2, c);
            float *to = inputs(y, 3 + c);
            for (int x = 0; x < w; x++) to[x] = from[x / 2];
            for (int x = 0; x < w; x += LANES) store(to + x, logged(load(to + x)));
        }
        inputs.trim(y);
    }
    void describe(int y) {  // the latents of a row, as features
        if (y < 0) return seen.clear(y);
        for (int c = 0; c < 9; c++)
            for (int x = 0; x < w; x += LANES) {
                const vec v = load(s.latents(y, c) + x);
                store(seen(y, c) + x, bounded(v, 4)), store(seen(y, 9 + c) + x, logged(v));
            }
    }
    // Keeps what is within bounds, and that it is.
    auto active(Floats &to, Passed &passed, int y, const Floats *more = nullptr) {
        passed.words.clear(y);
        return [&to, &passed, y, more](int o, int x, vec v) {
            if (more) v += load((*more)(0, o) + x);
            passed.mark(y, o, x, (v > 0.f) & (v < ACTIVE));
            store(to(y, o) + x, least(most(v, (vec){}), all(ACTIVE)));
        };
    }
    void hide(int y) {  // the first layer
        if (y < 0 || y >= s.h) return once.clear(y);
        in.clear();
        square_terms(in, inputs, 0, 12, y, 1);
        sums.first(in.data(), w, active(once, s.first, y));
        once.trim(y);
    }
    void predict(int y) {
        in.clear();
        square_terms(in, once, 0, n, y, 1);
        for (int c = 0; c < 18; c++)
            for (int tap = 0; tap < CAUSAL; tap++) in.push_back(seen(y - 2 + tap / 5, c) + tap % 5 - 2);
        const int all_terms = sums.second.terms, few = n * 9;
        sums.second(in.data(), w, [&](int x, int end) { return near(y, x, end) ? all_terms : few; },
                    active(twice, s.second, y));
        in.clear(), row_terms(in, twice, 0, 0, n);
        sums.mix(in.data(), w, active(mixed, s.mix, y));
        in.clear(), row_terms(in, mixed, 0, 0, n);
        sums.luma(in.data(), w, [&](int o, int x, vec v) { store(out(0, o) + x, v); });
        in.clear(), row_terms(in, seen, y, 0, 3), row_terms(in, seen, y, 9, 12);
        sums.from_luma(in.data(), w, active(toned, s.luma, y, &mixed));
        in.clear(), row_terms(in, toned, 0, 0, n);
        sums.chroma(in.data(), w, [&](int o, int x, vec v) { store(out(0, 6 + o) + x, v); });
    }
    // Whether a latent that positions x .. end - 1 of a row see is not 0.
    bool near(int y, int x, int end) const {
        uint8_t any = 0;
        for (int r = std::max(y - 2, 0); r <= y; r++)
            for (int k = x - 2; k < end + 2; k++) any |= s.busy(r)[k];
        return any;
    }
    // Bits of a row; its slopes, and what moves cost.
    double price_row(int y) {
        vec total = {};
        for (int c = 0; c < 9; c++) {
            const float *mean = out(0, mean_at(c)), *scale = out(0, scale_at(c)), shift = s.weights.shifts[c >= 3];
            const float unit = s.weights.gain[c] * s.weights.gain[c];
            for (int x = 0; x < w; x += LANES) {
                const vec raw = load(scale + x), low = all(-4.f), high = all(3.875f);
                const vec moved = least(most(raw, low), high) + shift;
                const vec within = chosen((raw >= low) & (raw <= high) & (moved >= low) & (moved <= high), all(1), (vec){});
                const Rate r = rate_of(load(s.latents(y, c) + x), load(mean + x), least(most(moved, low), high));
                vec counts = s.support.channels ? load(s.support(y, c) + x) : all(1);
                for (int i = std::max(w - x, 0); i < LANES; i++) counts[i] = 0;
                total += r.here * counts;
                counts *= price;
                store(s.slopes(y, mean_at(c)) + x, -r.slope * counts);
                store(s.slopes(y, scale_at(c)) + x, r.by_scale * counts * within);
                const vec bend = load(s.bends(y, c % 3) + x) * unit;
                store(s.up(y, c) + x, bend + price * (r.above - r.here));
                store(s.down(y, c) + x, bend + price * (r.below - r.here));
            }
        }
        return added(total);
    }

    // Adds the bits of a row under each shift of the log scales from -8 / 8 on, for luma and for chroma.
    void tally_row(int y, double *bits) {
        for (int c = 0; c < 9; c++)
            for (int shift = 0; shift < SHIFTS; shift++) {
                vec total = {};
                for (int x = 0; x < w; x += LANES) {
                    const vec low = all(-4.f), high = all(3.875f);
                    vec scale = least(most(load(out(0, scale_at(c)) + x), low), high) + (shift - 8) / 8.f;
                    scale = least(most(scale, low), high);
                    vec counts = s.support.channels ? load(s.support(y, c) + x) : all(1);
                    for (int i = std::max(w - x, 0); i < LANES; i++) counts[i] = 0;
                    total += rate_of(load(s.latents(y, c) + x), load(out(0, mean_at(c)) + x), scale).here * counts;
                }
                bits[(c >= 3) * SHIFTS + shift] += added(total);
            }
    }

  public:
    static constexpr int SHIFTS = 16;

    ContextForward(RefinedLevel &level, const ContextSums &sums, const RefinedLevel *parent, float price)
        : s(level), sums(sums), parent(parent), price(price), n(level.weights.context), w(level.w), inputs(12, w, 3),
          once(n, w, 3), seen(18, w, 3), twice(n, w, 1), mixed(n, w, 1), toned(n, w, 1), out(18, w, 1) {}

    // Calls f(y) for rows from .. to - 1 when what they need is there.
    template <class F> void each(int from, int to, F f) {
        for (int t = from - 2; t < to + 2; t++) {
            read(t);
            if (t > from - 1) hide(t - 1);
            if (t >= from) describe(t - 2);
            if (t >= from + 2) f(t - 2);
        }
    }
    // Rows from .. to - 1; bits of each.
    void run(int from, int to, double *bits) {
        each(from, to, [&](int y) { predict(y), bits[y] = price_row(y); });
    }
    // Bits [2][SHIFTS] of every third row, added up in rows of `bits`.
    void tally(int from, int to, double *bits) {
        each(from, to, [&](int y) {
            if (y % 3 == 0) predict(y), tally_row(y, bits + (int64_t)y * 2 * SHIFTS);
        });
    }
};

class ContextBackward {
    RefinedLevel &s;
    const ContextSums &sums;
    RefinedLevel *parent;
    const int n, w;
    Floats toned, mixed, twice, once, inputs;
    Terms in;

    // Gradient of what the causal and the second layer give in row y.
    void begin(int y, bool own) {
        if (y < 0 || y >= s.h) return twice.clear(y);
        in.clear(), row_terms(in, s.slopes, y, 6, 18);
        sums.chroma_back(in.data(), w, [&](int o, int x, vec v) { store(toned(0, o) + x, s.luma.of(y, o, x, v)); });
        if (own) {
            in.clear(), row_terms(in, toned, 0, 0, n);
            sums.from_luma_back(in.data(), w, [&](int o, int x, vec v) { by_feature(y, o % 3, o >= 3, x, v); });
        }
        in.clear(), row_terms(in, s.slopes, y, 0, 6);
        sums.luma_back(in.data(), w, [&](int o, int x, vec v) {
            store(mixed(0, o) + x, s.mix.of(y, o, x, v + load(toned(0, o) + x)));
        });
        in.clear(), row_terms(in, mixed, 0, 0, n);
        sums.mix_back(in.data(), w, [&](int o, int x, vec v) { store(twice(y, o) + x, s.second.of(y, o, x, v)); });
        twice.trim(y);
    }
    void by_feature(int y, int c, bool log, int x, vec v) {
        const vec value = load(s.latents(y, c) + x);
        float *to = s.by_latents(y, c) + x;
        store(to, load(to) + v * (log ? by_logged(value) : by_bounded(value, 4)));
    }
    void to_latents(int y) {
        in.clear();
        for (int o = 0; o < n; o++)
            for (int tap = 0; tap < CAUSAL; tap++) in.push_back(twice(y + 2 - tap / 5, o) + 2 - tap % 5);
        sums.causal_back(in.data(), w, [&](int o, int x, vec v) { by_feature(y, o % 9, o >= 9, x, v); });
    }
    void to_once(int y) {
        if (y < 0 || y >= s.h) return once.clear(y);
        in.clear(), square_terms(in, twice, 0, n, y, 1, -1);
        sums.second_back(in.data(), w, [&](int o, int x, vec v) { store(once(y, o) + x, s.first.of(y, o, x, v)); });
        once.trim(y);
    }
    void to_inputs(int y) {
        in.clear(), square_terms(in, once, 0, n, y, 1, -1);
        sums.first_back(in.data(), w, [&](int o, int x, vec v) { store(inputs(0, o) + x, v); });
        for (int c = 0; c < 3; c++) {
            float *to = s.by_inputs[0](y, c);
            high_pass(s.plain, c, y, s.h, to);
            for (int x = 0; x < w; x += LANES)
                store(to + x, load(inputs(0, c) + x) * by_bounded(load(to + x), 4));
        }
        s.by_inputs[0].trim(y);
        for (int c = 0; parent && c < 9; c++) {
            float *to = parent->by_latents(y / 2, c), *from = inputs(0, 3 + c);
            const float *value = parent->latents(y / 2, c);
            for (int x = 0; x < w; x++) {
                const float v = value[x / 2], slope = from[x] / (1 + std::abs(v));
                to[x / 2] += v > 0 ? slope : v < 0 ? -slope : 0;
            }
        }
    }

  public:
    ContextBackward(RefinedLevel &level, const ContextSums &sums, RefinedLevel *parent)
        : s(level), sums(sums), parent(parent), n(level.weights.context), w(level.w), toned(n, w, 1), mixed(n, w, 1),
          twice(n, w, 3), once(n, w, 3), inputs(12, w, 1) {}

    // Rows from .. to - 1, of which the first is even: adds to the slopes of the latents and the parent's.
    void run(int from, int to) {
        for (int t = from - 2; t < to + 2; t++) {
            begin(t, t >= from && t < to);
            if (t - 1 >= from - 1) to_once(t - 1);
            if (t - 2 < from) continue;
            to_latents(t - 2), to_inputs(t - 2);
        }
    }
};

}  // namespace PXI_LEVEL
