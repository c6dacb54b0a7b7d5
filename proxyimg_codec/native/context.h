// The context network of the pyramid, texture/context.py, statement by statement; numpy is its judge.
#pragma once

#include "laplace.h"
#include "linear.h"

namespace PXI_LEVEL {

struct ContextNet {  // of one level: weights [out][in].., as in texture/registered_model.py
    const int32_t *first, *first_bias, *second, *second_bias, *causal, *mix, *mix_bias, *luma, *luma_bias,
        *from_luma, *from_luma_bias, *chroma, *chroma_bias;
    // The products of each are in units of 2**-bits of what they give.
    int32_t first_bits, second_bits, causal_bits, mix_bits, luma_bits, from_luma_bits, chroma_bits, hidden;
};
struct Level {
    ContextNet net;
    Tables tables;
    Source source;
    Sink sink;
    int32_t height, width, grey, shifts[2];
    const int32_t *logs;     // [n_logs] feature of a magnitude; greater ones have the last
    int64_t n_logs;
    const int32_t *low;      // [3][height][width]
    const int32_t *parent;   // [9][(height + 1) / 2][(width + 1) / 2]
    const uint8_t *bands;    // [height][width], bit b set where band b is coded
    const int32_t *given;    // [9][height][width] to encode, or null to decode
    int32_t *latents;        // [9][height][width], 0
    int (*watch)(int done, int all);  // hears of progress, and stops the work by a 1; or null
};

struct Lowest {  // planes, decoded by ascending x + y
    Tables tables;
    Source source;
    int32_t scales[3], count, height, width;
    int32_t *out;  // [count][height][width], 0
};

inline Wrong decode_lowest(Lowest &s) {
    Sink sink{};
    LatentCoder coder{s.tables, s.source, sink};
    const int h = s.height, w = s.width;
    std::vector<Symbol> symbols;
    for (int t = 0; t < h + w - 1; t++) {
        const int first = std::max(t - w + 1, 0), last = std::min(t, h - 1);
        symbols.clear();
        for (int i = first; i <= last; i++)
            for (int c = 0; c < s.count; c++) {
                const int32_t *here = s.out + ((int64_t)c * h + i) * w + t - i;
                const int up = i ? here[-w] : 0, left = t > i ? here[-1] : 0;
                symbols.push_back(coder.located((i && t > i ? 8 : 16) * (up + left), s.scales[c]));
            }
        if (const Wrong wrong = coder.decode(symbols)) return wrong;
        const Symbol *next = symbols.data();
        for (int i = first; i <= last; i++)
            for (int c = 0; c < s.count; c++, next++)
                s.out[((int64_t)c * h + i) * w + t - i] = next->row < 0 ? 0 : (int32_t)next->value;
    }
    return NOTHING;
}

typedef Linear<Whole, 2> Layer;
typedef Layer::Sums Sums;
typedef int16_t shorts __attribute__((vector_size(2 * LANES)));

// Sums of whole numbers times 2**-bits, rounded down: the layers have added a half.
static inline Sums scaled(Sums v, int bits) {
    for (ints &x : v.v) x = bits > 0 ? x >> bits : x << -bits;
    return v;
}
static int half(int bits) { return bits > 0 ? 1 << (bits - 1) : 0; }

// Layer::UNIT numbers to memory, within bounds, and from there.
static inline void put(int16_t *to, Sums s, int32_t low, int32_t high) {
    for (ints v : s.v) {
        v = v < low ? (ints){} + low : v;
        const shorts n = __builtin_convertvector(v > high ? (ints){} + high : v, shorts);
        std::memcpy(to, &n, sizeof n);
        to += LANES;
    }
}
static inline Sums get(const int16_t *from) {
    Sums out;
    for (ints &v : out.v) {
        shorts n;
        std::memcpy(&n, from, sizeof n);
        v = __builtin_convertvector(n, ints);
        from += LANES;
    }
    return out;
}

class LevelCoder {
    static constexpr int FAR = 508;  // from here on the squashed feature is 127

    const Level &s;
    LatentCoder coder;
    const int h, w, hidden, width;  // width: hidden units with padding
    const int64_t size, pitch, in_row, row;
    Layer first, second, causal, mix, luma, from_luma, chroma;
    int16_t squash[FAR + 1];
    std::vector<int16_t> inputs, rows;   // three rows [w + 2][12], [w + 2][width]
    std::vector<int16_t> ahead, seen;    // [h][w][width], [h + 2][pitch][18]
    std::vector<uint8_t> busy;           // [h + 2][pitch] whether a latent is not 0
    // Of a wave: positions (ys[i], wave - 3 ys[i]), activations [width], features, outputs, latents [9],
    // and which positions are not quiet.
    int at;
    std::vector<int32_t> ys, outputs, found, loud;
    std::vector<int16_t> z, mixed, features;
    std::vector<Symbol> symbols;         // those that are not certain
    std::vector<int32_t> places;         // in `found` of their values

    // 32 x / (1 + x / 4) for x = numerator / unit >= 0.
    static int squashed(int numerator, int unit) {
        const int v = std::min(numerator, FAR * unit), under = 4 * unit + v;
        return (128 * v + under / 2) / under;
    }
    int16_t feature(int v) const { return v < 0 ? -squash[std::min(-v, FAR)] : squash[std::min(v, FAR)]; }
    int16_t log_feature(int v) const { return (int16_t)s.logs[std::min<int64_t>(std::abs(v), s.n_logs - 1)]; }
    int64_t index(int i) const { return (int64_t)ys[i] * w + at - 3 * ys[i]; }
    int16_t *own(int i) { return z.data() + (int64_t)i * width; }
    int64_t padded(int i) const { return (ys[i] + 2) * pitch + at - 3 * ys[i] + 2; }
    int16_t *place(int i) { return seen.data() + 18 * padded(i); }

    // Whether all latents that the causal layer sees are 0, so that it adds nothing.
    bool quiet(int i) const {
        const uint8_t *here = busy.data() + padded(i);
        uint64_t up, above;
        uint16_t left;
        std::memcpy(&up, here - 2 * pitch - 2, 8), std::memcpy(&above, here - pitch - 2, 8);
        std::memcpy(&left, here - 2, 2);
        const uint8_t five[8] = {1, 1, 1, 1, 1};
        uint64_t mask;
        std::memcpy(&mask, five, 8);
        return !(((up | above) & mask) | left);
    }

    // A row of inputs.
    void read(int y, int16_t *to) const {
        if (y >= h) {
            std::fill_n(to, in_row, (int16_t)0);
            return;
        }
        to += 12;
        for (int c = 0; c < 3; c++) {
            const int32_t *middle = s.low + c * size + (int64_t)y * w, *up = y ? middle - w : middle,
                          *down = y + 1 < h ? middle + w : middle;
            const auto column = [&](int x) { return up[x] + middle[x] + down[x]; };
            for (int x = 0; x < w; x++) {
                const int around = column(std::max(x - 1, 0)) + column(x) + column(std::min(x + 1, w - 1));
                const int v = 9 * middle[x] - around, f = squashed(std::abs(v), 144);
                to[12 * x + c] = (int16_t)(v < 0 ? -f : f);
            }
        }
        const int64_t half = (w + 1) / 2, quarter = half * ((h + 1) / 2);
        for (int c = 0; c < 9; c++) {
            const int32_t *from = s.parent + c * quarter + (y / 2) * half;
            for (int x = 0; x < w; x++) to[12 * x + 3 + c] = log_feature(from[x / 2]);
        }
    }

    // Tells what is done, now and then; whether to stop.
    bool stopped(int done) const {
        return s.watch && done % 16 == 0 && s.watch(done, h + w + 3 * (h - 1));
    }

    // What does not depend on the level itself.
    Wrong look_ahead() {
        int16_t *last_in = inputs.data() + 2 * in_row, *last = rows.data() + 2 * row;
        read(0, last_in);
        for (int y = 0; y <= h; y++) {
            if (stopped(y)) return STOPPED;
            std::memmove(inputs.data(), inputs.data() + in_row, 2 * in_row * sizeof(int16_t));
            std::memmove(rows.data(), rows.data() + row, 2 * row * sizeof(int16_t));
            read(y + 1, last_in);
            const auto window = [&](int x) { return inputs.data() + 12 * x; };
            const auto wider = [&](int x) { return rows.data() + (int64_t)x * width; };
            if (y < h)
                first(w, window, [&](int x, int o, Sums v) {
                    put(last + (int64_t)(x + 1) * width + o, scaled(v, s.net.first_bits), 0, 255);
                });
            else
                std::fill_n(last, row, (int16_t)0);
            if (y > 0)
                second(w, wider, [&](int x, int o, Sums v) {
                    const int64_t i = (int64_t)(y - 1) * w + x;
                    put(ahead.data() + i * width + o, scaled(v, s.net.second_bits), -32768, 32767);
                });
        }
        return NOTHING;
    }

    // Codes the positions of a wave.
    Wrong wave() {
        const int n = (int)ys.size();
        const auto mine = [&](int i) { return own(i); };
        const auto begin = [&](int i, int o, Sums v) {
            const Sums more = get(ahead.data() + index(i) * width + o);
            for (int k = 0; k < 2; k++) v.v[k] = (v.v[k] + more.v[k] + 4) >> 3;
            put(own(i) + o, v, 0, 255);
        };
        loud.clear();
        for (int i = 0; i < n; i++)
            if (!quiet(i))
                loud.push_back(i);
            else
                for (int o = 0; o < width; o += Layer::UNIT) begin(i, o, {});
        causal((int)loud.size(), [&](int k) { return place(loud[k]); }, [&](int k, int o, Sums v) {
            begin(loud[k], o, scaled(v, s.net.causal_bits));
        });
        mix(n, mine, [&](int i, int o, Sums v) {
            put(mixed.data() + (int64_t)i * width + o, scaled(v, s.net.mix_bits), 0, 255);
        });
        z.swap(mixed);
        if (const Wrong wrong = coded(luma, s.net.luma_bits, 0, 3, s.shifts[0])) return wrong;
        if (!s.grey) {
            for (int i = 0; i < n; i++) described(features.data() + 6 * i, i, 3);
            from_luma(n, [&](int i) { return features.data() + 6 * i; }, [&](int i, int o, Sums v) {
                const Sums before = get(own(i) + o);
                v = scaled(v, s.net.from_luma_bits);
                for (int k = 0; k < 2; k++) v.v[k] = (8 * before.v[k] + v.v[k] + 4) >> 3;
                put(own(i) + o, v, 0, 255);
            });
            if (const Wrong wrong = coded(chroma, s.net.chroma_bits, 3, 6, s.shifts[1])) return wrong;
        }
        for (int i = 0; i < n; i++) {
            const int32_t *own = found.data() + 9 * i;
            if (std::all_of(own, own + 9, [](int32_t v) { return v == 0; })) continue;
            described(place(i), i, 9);
            busy[padded(i)] = 1;
        }
        return NOTHING;
    }

    // Two features each of the first `count` latents of a position.
    void described(int16_t *to, int i, int count) const {
        for (int c = 0; c < count; c++) {
            const int32_t v = found[9 * i + c];
            to[c] = feature(v), to[count + c] = log_feature(v);
        }
    }

    // Codes channels from .. from + count - 1 of the wave, whose distributions a layer gives.
    Wrong coded(const Layer &layer, int bits, int from, int count, int shift) {
        const int n = (int)ys.size(), stride = layer.outputs();
        layer(n, [&](int i) { return own(i); }, [&](int i, int o, Sums v) {
            std::memcpy(outputs.data() + (int64_t)i * stride + o, &v, sizeof v);
        });
        symbols.clear(), places.clear();
        for (int i = 0; i < n; i++) {
            const int bands = s.bands[index(i)];
            for (int c = 0; c < count; c++) {
                found[9 * i + from + c] = 0;
                if (!(bands >> c % 3 & 1)) continue;
                const int32_t *out = outputs.data() + (int64_t)i * stride + c;
                const int mean = (out[0] + (1 << bits >> 1)) >> bits;
                const int scale = ((out[count] + (1 << bits)) >> (bits + 1)) + 32 + shift;
                const Symbol symbol = coder.located(std::clamp(mean, -(1 << 14), 1 << 14),
                                                    std::clamp(scale, 0, s.tables.scales - 1));
                if (symbol.row < 0) continue;
                symbols.push_back(symbol), places.push_back(9 * i + from + c);
                if (s.given) symbols.back().value = s.given[(from + c) * size + index(i)];
            }
        }
        if (s.given)
            coder.encode(symbols);
        else if (const Wrong wrong = coder.decode(symbols))
            return wrong;
        for (size_t k = 0; k < symbols.size(); k++)
            if (const int32_t value = (int32_t)symbols[k].value) {  // they are 0 already
                found[places[k]] = value;
                s.latents[places[k] % 9 * size + index(places[k] / 9)] = value;
            }
        return NOTHING;
    }

  public:
    explicit LevelCoder(Level &level)
        : s(level), coder{level.tables, level.source, level.sink}, h(s.height), w(s.width),
          hidden(s.net.hidden), width(Layer::padded(hidden)), size((int64_t)h * w), pitch(w + 4),
          in_row((w + 2) * 12), row((int64_t)(w + 2) * width),
          first(square(3, 12, in_row), hidden, s.net.first_bias, half(s.net.first_bits)),
          second(square(3, width, row), hidden, s.net.second_bias, half(s.net.second_bits)),
          causal({{-36 * (pitch + 1), 90}, {-18 * (pitch + 2), 90}, {-36, 36}}, hidden, nullptr,
                 half(s.net.causal_bits)),
          mix({{0, width}}, hidden, s.net.mix_bias, half(s.net.mix_bits)),
          luma({{0, width}}, 6, s.net.luma_bias),
          from_luma({{0, 6}}, hidden, s.net.from_luma_bias, half(s.net.from_luma_bits)),
          chroma({{0, width}}, 12, s.net.chroma_bias), inputs(3 * in_row), rows(3 * row),
          ahead(size * width), seen((h + 2) * pitch * 18), busy((h + 2) * pitch + 8) {
        const ContextNet &n = s.net;
        const size_t most = std::min(h, (w + 2) / 3);  // positions of a wave
        z.resize(most * width), mixed.resize(most * width), features.resize(most * 6), found.resize(most * 9);
        outputs.resize(most * chroma.outputs());
        for (int v = 0; v <= FAR; v++) squash[v] = (int16_t)squashed(v, 1);
        for (int o = 0; o < hidden; o++) {
            for (int tap = 0; tap < 9; tap++) {
                for (int i = 0; i < 12; i++) first.set(12 * tap + i, o, n.first[(o * 12 + i) * 9 + tap]);
                for (int i = 0; i < hidden; i++)
                    second.set(width * tap + i, o, n.second[(o * hidden + i) * 9 + tap]);
            }
            for (int tap = 0; tap < 12; tap++)
                for (int i = 0; i < 18; i++) causal.set(18 * tap + i, o, n.causal[(o * 18 + i) * 12 + tap]);
            for (int i = 0; i < hidden; i++) mix.set(i, o, n.mix[o * hidden + i]);
            for (int i = 0; i < 6; i++) from_luma.set(i, o, n.from_luma[o * 6 + i]);
            for (int i = 0; i < 6; i++) luma.set(o, i, n.luma[i * hidden + o]);
            for (int i = 0; i < 12; i++) chroma.set(o, i, n.chroma[i * hidden + o]);
        }
    }

    // Codes the level.
    Wrong run() {
        if (const Wrong wrong = look_ahead()) return wrong;
        for (at = 0; at < w + 3 * (h - 1); at++) {
            if (stopped(h + at)) return STOPPED;
            ys.clear();
            for (int y = std::max((at - w + 3) / 3, 0); y <= std::min(at / 3, h - 1); y++)
                if (s.bands[(int64_t)y * w + at - 3 * y]) ys.push_back(y);
            if (!ys.empty())
                if (const Wrong wrong = wave()) return wrong;
        }
        return NOTHING;
    }
};

}  // namespace PXI_LEVEL
