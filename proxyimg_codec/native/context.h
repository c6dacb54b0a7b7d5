// The context network of the pyramid, texture/context.py, statement by statement; numpy is its judge.
#pragma once

#include <memory>

#include "bytes.h"
#include "laplace.h"
#include "linear.h"
#include "window.h"

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
    // Hears of progress, and stops the work by a 1; or null. Position (y, x) is coded when more than x + 3 y is
    // done.
    int (*watch)(int done, int all);
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

typedef Linear<Whole, 2> Signed;  // layers of features, and of activations
typedef Active<2> Layer;
typedef Active<LANES == 4 ? 2 : 1> Six;
typedef Active<LANES == 4 ? 3 : LANES == 8 ? 2 : 1> Twelve;
typedef Vectors<ints, 2> Sums;
typedef int16_t shorts __attribute__((vector_size(2 * LANES)));

// Sums of whole numbers times 2**-bits, rounded down: the layers have added a half.
static inline Sums scaled(Sums v, int bits) {
    for (ints &x : v.v) x = bits > 0 ? x >> bits : x << -bits;
    return v;
}
static int half(int bits) { return bits > 0 ? 1 << (bits - 1) : 0; }

// Numbers to memory, within the bounds of int16, and from there.
static inline void put(int16_t *to, Sums s, int32_t low, int32_t high) {
    for (ints v : s.v) {
        v = v < low ? (ints){} + low : v;
        const shorts n = __builtin_convertvector(v > high ? (ints){} + high : v, shorts);
        std::memcpy(to, &n, sizeof n);
        to += LANES;
    }
}
template <class Number> static inline Sums get(const Number *from) {
    typedef Number numbers __attribute__((vector_size(sizeof(Number) * LANES)));
    Sums out;
    for (ints &v : out.v) {
        numbers n;
        std::memcpy(&n, from, sizeof n);
        v = __builtin_convertvector(n, ints);
        from += LANES;
    }
    return out;
}

// Activations to memory.
static inline void activate(int16_t *to, Sums s) { put(to, s, 0, 255); }
#if defined(__AVX2__) && !defined(__AVX512F__)
static inline void activate(uint8_t *to, Sums s) {  // packing saturates
    __m256i n = _mm256_packs_epi32((__m256i)s.v[0], (__m256i)s.v[1]);
    n = _mm256_permute4x64_epi64(n, 0xd8);
    const __m128i all = _mm_packus_epi16(_mm256_castsi256_si128(n), _mm256_extracti128_si256(n, 1));
    std::memcpy(to, &all, sizeof all);
}
#else
static inline void activate(uint8_t *to, Sums s) {
    typedef uint8_t bytes __attribute__((vector_size(LANES)));
    for (ints v : s.v) {
        v = v < 0 ? (ints){} : v;
        const bytes n = __builtin_convertvector(v > 255 ? (ints){} + 255 : v, bytes);
        std::memcpy(to, &n, sizeof n);
        to += LANES;
    }
}
#endif

// Tells outputs of a layer, `count` means and then as many scales, that make all latents certain.
template <class L> class Certain {
    typename L::Sums add{}, shift{}, low{}, high{};

  public:
    Certain(int bits, int count, int more, int certain) {
        const auto at = [](typename L::Sums &of, int i) -> int32_t & { return ((int32_t *)&of)[i]; };
        for (int i = 0; i < L::UNIT; i++) {
            const bool mean = i < count, scale = !mean && i < 2 * count;
            at(add, i) = mean ? 1 << bits >> 1 : scale ? 1 << bits : 0;
            at(shift, i) = mean ? bits : scale ? bits + 1 : 0;
            at(low, i) = mean ? -4 : INT32_MIN;
            at(high, i) = mean ? 4 : scale ? certain - 32 - more : INT32_MAX;
        }
    }
    bool operator()(const typename L::Sums &v) const {
        ints not_so{};
        for (size_t k = 0; k < std::size(v.v); k++) {
            const ints n = (v.v[k] + add.v[k]) >> shift.v[k];
            not_so |= (n < low.v[k]) | (n > high.v[k]);
        }
        uint64_t parts[sizeof not_so / 8], any = 0;
        std::memcpy(parts, &not_so, sizeof not_so);
        for (const uint64_t part : parts) any |= part;
        return !any;
    }
};

class LevelCoder {
    static constexpr int FAR = 508;  // from here on the squashed feature is 127
    static constexpr int PLANES = 4;  // with padding
    static constexpr int ZERO = 128;  // what features are stored above, so that none is negative
    static constexpr int FIVE = 92;   // features of five positions, with padding

    const Level &s;
    LatentCoder coder;
    const int h, w, hidden, width;  // width: hidden units with padding
    const int64_t size, pitch, row;
    Layer first, first_planes, second, causal, mix;
    Signed from_luma;
    Six luma;
    Twelve chroma;
    Certain<Six> sure_luma;
    Certain<Twelve> sure_chroma;
    int16_t squash[FAR + 1];
    Window<Activation, PLANES> inputs;
    Rows<Activation> rows;               // of activations, [w + 2][width]
    const int most;                      // positions of a wave, and rows that it reaches
    const std::unique_ptr<int16_t[]> ahead;  // [most][w][width], row y in place of row y - most
    std::vector<std::pair<int, int>> spans;  // [h] from where to where anything is coded
    std::vector<Activation> seen;        // [h + 2][pitch][18]
    std::vector<uint8_t> busy;           // [h + 2][pitch] whether a latent is not 0
    // Of a wave: positions (ys[i], wave - 3 ys[i]), their places in `ahead`, activations [width], features,
    // latents [9], whether one of these is not 0, and lists of positions: some to work on, and those with
    // such latents.
    int at;
    std::vector<int32_t> ys, found, some, alive;
    std::vector<const int16_t *> before;
    std::vector<Activation> z, mixed;
    std::vector<int16_t> features;
    std::vector<uint8_t> lit;
    std::vector<int16_t> dark;           // [width] what latents of luma that are 0 add to activations, within +-256
    std::vector<Symbol> symbols;         // those that are not certain
    std::vector<int32_t> places;         // in `found` of their values
    std::vector<int32_t> sums;           // [w + 2] of three rows
    std::vector<float> high;             // [w]
    std::vector<uint8_t> coarse;         // [(w + 1) / 2] whether a latent of the parents is not 0

    // 32 x / (1 + x / 4) for x = n / unit, 0 <= n <= FAR * unit, a whole number. The quotient of floats,
    // which hold all that is below 2**24, does not reach the next whole number by rounding.
    static float squashed(int n, int unit) {
        const int under = 4 * unit + n;
        return (float)(128 * n + under / 2) / (float)under;
    }
    int16_t feature(int v) const { return v < 0 ? -squash[std::min(-v, FAR)] : squash[std::min(v, FAR)]; }
    int16_t log_feature(int v) const { return (int16_t)s.logs[std::min<int64_t>(std::abs(v), s.n_logs - 1)]; }
    int16_t *ahead_of(int y) const { return ahead.get() + (int64_t)(y % most) * w * width; }
    int64_t index(int i) const { return (int64_t)ys[i] * w + at - 3 * ys[i]; }
    Activation *own(int i) { return z.data() + (int64_t)i * width; }
    int64_t padded(int i) const { return (ys[i] + 2) * pitch + at - 3 * ys[i] + 2; }
    Activation *place(int i) { return seen.data() + 18 * padded(i); }

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

    // The last row of inputs.
    void read(int y) {
        Activation *to = inputs.all[2];
        uint8_t *any = inputs.busy[2];
        if (y < h && y % 2) {  // the same parents
            std::copy_n(inputs.all[1], (w + 2) * 12, to), std::copy_n(inputs.busy[1], w + 2, any);
        } else {
            std::fill_n(to, (w + 2) * 12, (Activation)ZERO), std::fill_n(any, w + 2, (uint8_t)0);
            if (y < h) read_parents(y / 2, to + 12, any + 1);
        }
        for (int c = 0; c < 3 && y < h; c++) read_plane(c, y, to + 12 + c);
        inputs.filled(2);
    }
    void read_plane(int c, int y, Activation *to) {
        const int32_t *middle = s.low + c * size + (int64_t)y * w, *up = y ? middle - w : middle,
                      *down = y + 1 < h ? middle + w : middle;
        int32_t *column = sums.data() + 1;
        float *out = high.data();
        for (int x = 0; x < w; x++) column[x] = up[x] + middle[x] + down[x];
        column[-1] = column[0], column[w] = column[w - 1];
        for (int x = 0; x < w; x++) {
            const int v = 9 * middle[x] - (column[x - 1] + column[x] + column[x + 1]);
            const float f = squashed(std::min(std::abs(v), FAR * 144), 144);
            out[x] = v < 0 ? -f : f;
        }
        for (int x = 0; x < w; x++) to[12 * x] = (Activation)(ZERO + (int)out[x]);
    }
    void read_parents(int y, Activation *to, uint8_t *any) {
        const int half = (w + 1) / 2;
        const int64_t quarter = (int64_t)half * ((h + 1) / 2);
        find_busy(s.parent, quarter, (int64_t)y * half, half, coarse.data());
        for (int x = 0; x < w; x++) {
            if (!(any[x] = coarse[x / 2])) continue;
            const int32_t *from = s.parent + (int64_t)y * half + x / 2;
            for (int c = 0; c < 9; c++) to[12 * x + 3 + c] = (Activation)(ZERO + log_feature(from[c * quarter]));
        }
    }

    // The next row of the first layer, where something is coded at it or beside it.
    void hide(int y) {
        inputs.up(), rows.up();
        read(y + 1);
        Activation *to = rows[2];
        if (y >= h) {
            std::fill_n(to, row, (Activation)0);
            return;
        }
        int from = w, end = 0;
        for (int k = std::max(y - 1, 0); k < std::min(y + 2, h); k++)
            from = std::min(from, spans[k].first), end = std::max(end, spans[k].second);
        inputs(first, first_planes, std::max(from - 1, 0), std::min(end + 1, w), [&](int x, int o, Sums v) {
            activate(to + (int64_t)(x + 1) * width + o, scaled(v, s.net.first_bits));
        });
    }
    // What does not depend on the level itself, of the next row.
    void look_ahead(int y) {
        if (y == 0) read(0), hide(0);
        hide(y + 1);
        const auto [from, end] = spans[y];
        const Activation *above = rows[0] + (int64_t)from * width;
        int16_t *to = ahead_of(y) + (int64_t)from * width;
        second(end - from, [&](int k) { return above + (int64_t)k * width; }, [&](int k, int o, Sums v) {
            put(to + (int64_t)k * width + o, scaled(v, s.net.second_bits), -32768, 32767);
        });
    }

    // Codes the positions of a wave.
    Wrong wave() {
        const int n = (int)ys.size();
        const auto mine = [&](int i) { return own(i); };
        const auto begin = [&](int i, int o, Sums v) {
            const Sums more = get(before[i] + o);
            for (int k = 0; k < 2; k++) v.v[k] = (v.v[k] + more.v[k] + 4) >> 3;
            activate(own(i) + o, v);
        };
        some.clear();
        for (int i = 0; i < n; i++) {
            __builtin_prefetch(before[i] + 2 * width);
            if (!quiet(i))
                some.push_back(i);
            else
                begin_quiet(before[i], own(i));
        }
        causal((int)some.size(), [&](int k) { return place(some[k]); }, [&](int k, int o, Sums v) {
            begin(some[k], o, scaled(v, s.net.causal_bits));
        });
        mix(n, mine, [&](int i, int o, Sums v) {
            activate(mixed.data() + (int64_t)i * width + o, scaled(v, s.net.mix_bits));
        });
        z.swap(mixed);
        alive.clear();
        if (const Wrong wrong = coded(luma, s.net.luma_bits, 0, 3, s.shifts[0], sure_luma)) return wrong;
        if (!s.grey) {
            add_luma(n);
            if (const Wrong wrong = coded(chroma, s.net.chroma_bits, 3, 6, s.shifts[1], sure_chroma)) return wrong;
        }
        for (const int i : alive) {
            described(place(i), i, 9, ZERO);
            busy[padded(i)] = 1, lit[i] = 0;
            std::fill_n(found.data() + 9 * i, 9, 0);
        }
        return NOTHING;
    }

    // Activations of a position around which all latents are 0: (v + 4) >> 3, within the bounds of int16.
    void begin_quiet(const int16_t *__restrict from, Activation *__restrict to) const {
        for (int o = 0; o < width; o++) {
            const int16_t v = (int16_t)((from[o] >> 3) + (from[o] >> 2 & 1));
            to[o] = (Activation)std::clamp<int16_t>(v, 0, 255);
        }
    }

    // Adds what the luma of the n positions of a wave tells of their chroma.
    void add_luma(int n) {
        const auto add = [&](int i, int o, Sums v) {
            const Sums before = get(own(i) + o);
            for (int k = 0; k < 2; k++) v.v[k] = (8 * before.v[k] + v.v[k] + 4) >> 3;
            activate(own(i) + o, v);
        };
        for (int i = 0; i < n; i++)
            if (!lit[i]) darken(own(i));
        const int count = (int)alive.size();
        for (int k = 0; k < count; k++) described(features.data() + 6 * k, alive[k], 3, 0);
        from_luma(count, [&](int k) { return features.data() + 6 * k; }, [&](int k, int o, Sums v) {
            add(alive[k], o, scaled(v, s.net.from_luma_bits));
        });
    }

    // Adds what luma that is 0 tells of a position: v + ((dark + 4) >> 3).
    void darken(Activation *__restrict to) const {
        const int16_t *more = dark.data();
        for (int o = 0; o < width; o++) to[o] = (Activation)std::clamp<int16_t>((int16_t)(to[o] + more[o]), 0, 255);
    }

    // Two features each of the first `count` latents of a position, and `zero` more.
    template <class Number> void described(Number *to, int i, int count, int zero) const {
        for (int c = 0; c < count; c++) {
            const int32_t v = found[9 * i + c];
            to[c] = (Number)(zero + feature(v)), to[count + c] = (Number)(zero + log_feature(v));
        }
    }

    // Codes channels from .. from + count - 1 of the wave, whose distributions a layer gives.
    template <class L> Wrong coded(const L &layer, int bits, int from, int count, int shift, const Certain<L> &sure) {
        const int n = (int)ys.size();
        symbols.clear(), places.clear();
        layer(n, [&](int i) { return own(i); }, [&](int i, int, typename L::Sums v) {
            if (sure(v)) return;
            int32_t out[L::UNIT];
            v.put(out);
            const int bands = s.bands[index(i)];
            for (int c = 0; c < count; c++) {
                if (!(bands >> c % 3 & 1)) continue;
                const int mean = (out[c] + (1 << bits >> 1)) >> bits;
                const int scale = ((out[count + c] + (1 << bits)) >> (bits + 1)) + 32 + shift;
                const Symbol symbol = coder.located(std::clamp(mean, -(1 << 14), 1 << 14),
                                                    std::clamp(scale, 0, s.tables.scales - 1));
                if (symbol.row < 0) continue;
                symbols.push_back(symbol), places.push_back(9 * i + from + c);
                if (s.given) symbols.back().value = s.given[(from + c) * size + index(i)];
            }
        });
        if (s.given)
            coder.encode(symbols);
        else if (const Wrong wrong = coder.decode(symbols))
            return wrong;
        for (size_t k = 0; k < symbols.size(); k++)
            if (const int32_t value = (int32_t)symbols[k].value) {  // they are 0 already
                const int i = places[k] / 9;
                found[places[k]] = value;
                s.latents[places[k] % 9 * size + index(i)] = value;
                if (!lit[i]) lit[i] = 1, alive.push_back(i);
            }
        return NOTHING;
    }

  public:
    explicit LevelCoder(Level &level)
        : s(level), coder{level.tables, level.source, level.sink}, h(s.height), w(s.width),
          hidden(s.net.hidden), width(Layer::padded(hidden)), size((int64_t)h * w), pitch(w + 4),
          row((int64_t)(w + 2) * width),
          first(square(3, 12, (w + 2) * 12), hidden, s.net.first_bias, half(s.net.first_bits)),
          first_planes(square(3, PLANES, (w + 2) * PLANES), hidden, s.net.first_bias, half(s.net.first_bits)),
          second(square(3, width, row), hidden, s.net.second_bias, half(s.net.second_bits)),
          causal({{-36 * (pitch + 1), FIVE}, {-18 * (pitch + 2), FIVE}, {-36, 36}}, hidden, nullptr,
                 half(s.net.causal_bits)),
          mix({{0, width}}, hidden, s.net.mix_bias, half(s.net.mix_bits)),
          from_luma({{0, 6}}, hidden, s.net.from_luma_bias, half(s.net.from_luma_bits)),
          luma({{0, width}}, 6, s.net.luma_bias), chroma({{0, width}}, 12, s.net.chroma_bias),
          sure_luma(s.net.luma_bits, 3, s.shifts[0], s.tables.certain),
          sure_chroma(s.net.chroma_bits, 6, s.shifts[1], s.tables.certain), inputs(3, w + 2, ZERO), rows(3, row),
          most(std::min(h, (w + 2) / 3)), ahead(new int16_t[(int64_t)most * w * width]), spans(h),
          seen((h + 2) * pitch * 18 + FIVE, ZERO), busy((h + 2) * pitch + 8), dark(width), sums(w + 2), high(w),
          coarse((w + 1) / 2) {
        for (int y = 0; y < h; y++) {
            const uint8_t *coded = s.bands + (int64_t)y * w;
            int from = 0, end = w;
            while (from < w && !coded[from]) from++;
            while (end > from && !coded[end - 1]) end--;
            spans[y] = {from, end};
        }
        z.resize(most * width), mixed.resize(most * width), features.resize(most * 6), found.resize(most * 9);
        lit.resize(most);
        for (int v = 0; v <= FAR; v++) squash[v] = (int16_t)squashed(v, 1);
        set_weights(s.net);
        const int16_t nothing[6] = {};
        from_luma(1, [&](int) { return nothing; }, [&](int, int o, Sums v) {
            v = scaled(v, s.net.from_luma_bits);
            for (ints &x : v.v) x = (x + 4) >> 3;
            put(dark.data() + o, v, -256, 256);
        });
    }

    // Codes the level.
    Wrong run() {
        int ready = 0;  // rows of `ahead`
        for (at = 0; at < w + 3 * (h - 1); at++) {
            if (at % 16 == 0 && s.watch && s.watch(at, w + 3 * (h - 1))) return STOPPED;
            for (; ready < h && 3 * ready <= at; ready++) look_ahead(ready);
            ys.clear(), before.clear();
            for (int y = std::max((at - w + 3) / 3, 0); y <= std::min(at / 3, h - 1); y++)
                if (const int x = at - 3 * y; s.bands[(int64_t)y * w + x])
                    ys.push_back(y), before.push_back(ahead_of(y) + (int64_t)x * width);
            if (!ys.empty())
                if (const Wrong wrong = wave()) return wrong;
        }
        return NOTHING;
    }

  private:
    void set_weights(const ContextNet &n) {
        for (int o = 0; o < hidden; o++) {
            for (int tap = 0; tap < 9; tap++) {
                for (int i = 0; i < 12; i++) {
                    const int32_t weight = n.first[(o * 12 + i) * 9 + tap];
                    first.set(12 * tap + i, o, weight, ZERO);
                    if (i < 3) first_planes.set(PLANES * tap + i, o, weight, ZERO);
                }
                for (int i = 0; i < hidden; i++)
                    second.set(width * tap + i, o, n.second[(o * hidden + i) * 9 + tap]);
            }
            for (int tap = 0; tap < 12; tap++)
                for (int i = 0; i < 18; i++)
                    causal.set(tap / 5 * FIVE + tap % 5 * 18 + i, o, n.causal[(o * 18 + i) * 12 + tap], ZERO);
            for (int i = 0; i < hidden; i++) mix.set(i, o, n.mix[o * hidden + i]);
            for (int i = 0; i < 6; i++) from_luma.set(i, o, n.from_luma[o * 6 + i]);
            for (int i = 0; i < 6; i++) luma.set(o, i, n.luma[i * hidden + o]);
            for (int i = 0; i < 12; i++) chroma.set(o, i, n.chroma[i * hidden + o]);
        }
        first.ready(), first_planes.ready(), second.ready(), causal.ready(), mix.ready(), luma.ready(), chroma.ready();
    }
};

}  // namespace PXI_LEVEL
