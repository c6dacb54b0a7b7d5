#include "models.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace pxi {

#ifndef PXI_NO_MODELS
extern "C" const unsigned char pxi_pyramid_1[];
extern "C" const size_t pxi_pyramid_1_size;
static int built_in(void *, const char *, const void **bytes, size_t *count) {
    *bytes = pxi_pyramid_1, *count = pxi_pyramid_1_size;
    return 0;
}
#else
static int built_in(void *, const char *, const void **, size_t *) { return 1; }
#endif

namespace {

struct Registration {
    int number, file;
    bool padded;
};
static const char *const FILE_NAMES[] = {"pyramid-1.bin"};
static const Registration REGISTERED[] = {{1, 0, true}, {2, 0, false}};

}  // namespace

static const Registration *registration(int number) {
    for (const Registration &r : REGISTERED)
        if (r.number == number) return &r;
    return nullptr;
}

bool Models::registered(int number) { return registration(number); }
bool Models::padded(int number) { return registration(number)->padded; }

namespace {

// Arrays of a model's file, one after the other.
class Arrays {
    Bytes data;
    size_t at = 12;
    int exponent = 0;

  public:
    explicit Arrays(Bytes data) : data(data) {}
    void check(bool ok) const { supported(ok, "PYR-35", "the weights of the model are damaged"); }

    // The next array, of bytes or of 32 bits; its exponent is that of `exponent_of_last`.
    std::vector<int32_t> whole(int64_t count, bool wide) {
        const int64_t size = wide ? 4 : 1;
        check(at + 1 + count * size <= data.size());
        exponent = (int8_t)data[at];
        std::vector<int32_t> out(count);
        const uint8_t *from = data.data() + at + 1;
        for (int64_t i = 0; i < count; i++, from += size)
            out[i] = wide ? (int32_t)(from[0] | from[1] << 8 | from[2] << 16 | (uint32_t)from[3] << 24)
                          : (int8_t)from[0];
        at += 1 + count * size;
        return out;
    }
    int exponent_of_last() const { return exponent; }
    std::vector<float> real(int64_t count, bool wide) {
        const std::vector<int32_t> found = whole(count, wide);
        std::vector<float> out(count);
        for (int64_t i = 0; i < count; i++) out[i] = (float)std::ldexp((double)found[i], exponent);
        return out;
    }
    bool all() const { return at == data.size(); }
};

}  // namespace

// Half of the synthesis filters of the CDF 9/7 wavelet, orthonormal (PYR-32).
static double wavelet(bool high, int n) {
    static const double SMOOTH[] = {0.788485616406, 0.418092273222, -0.040689417609, -0.064538882629};
    static const double SHARP[] = {0.852698679009, -0.377402855613, -0.110624404418, 0.023849465020,
                                   0.037828455507};
    n = std::abs(high ? n - 1 : n);
    return high ? (n < 5 ? SHARP[n] : 0) : (n < 4 ? SMOOTH[n] : 0);
}

// Adds the wavelet to `delta` [12 outputs][12 planes][5][5].
static std::vector<float> with_wavelet(const std::vector<int32_t> &delta, int exponent) {
    std::vector<float> out(delta.size());
    for (int i = 0; i < (int)delta.size(); i++) {
        const int output = i / 300, plane = i / 25 % 12, q = i / 5 % 5 - 2, p = i % 5 - 2, band = plane / 3;
        double weight = 0;
        if (plane % 3 == output >> 2)
            weight = wavelet(band >> 1, (output >> 1 & 1) - 2 * q) * wavelet(band & 1, (output & 1) - 2 * p);
        out[i] = (float)(weight + (double)(float)std::ldexp((double)delta[i], exponent));
    }
    return out;
}

static void read_context(Arrays &a, Context &c, int64_t n) {
    c.first = a.whole(n * 108, false), c.first_exponent = a.exponent_of_last();
    c.first_bias = a.whole(n, true), c.first_by_step = a.whole(n, true);
    c.second = a.whole(n * n * 9, false), c.second_exponent = a.exponent_of_last();
    c.second_bias = a.whole(n, true);
    c.causal = a.whole(n * 216, false), c.causal_exponent = a.exponent_of_last();
    c.mix = a.whole(n * n, false), c.mix_exponent = a.exponent_of_last();
    c.mix_bias = a.whole(n, true);
    c.luma = a.whole(6 * n, false), c.luma_exponent = a.exponent_of_last();
    c.luma_bias = a.whole(6, true);
    c.from_luma = a.whole(n * 6, false), c.from_luma_exponent = a.exponent_of_last();
    c.from_luma_bias = a.whole(n, true);
    c.chroma = a.whole(12 * n, false), c.chroma_exponent = a.exponent_of_last();
    c.chroma_bias = a.whole(12, true);
}

static void read_synthesis(Arrays &a, Synthetic &s, int64_t n) {
    const std::vector<int32_t> delta = a.whole(3600, false);
    s.linear = with_wavelet(delta, a.exponent_of_last());
    s.gain = a.real(9, true), s.gain_by_step = a.real(9, true);
    s.first = a.real(n * 108, false), s.first_bias = a.real(n, true), s.first_by_step = a.real(n, true);
    s.second = a.real(n * n, false), s.second_bias = a.real(n, true);
    s.third = a.real(12 * n * 9, false), s.third_bias = a.real(12, true);
}

static std::unique_ptr<Weights> read(Bytes data) {
    Arrays a(data);
    a.check(data.size() >= 12 && !std::memcmp(data.data(), "PXIMODL1", 8));
    auto w = std::make_unique<Weights>();
    w->hidden = data[8] | data[9] << 8, w->context = data[10] | data[11] << 8;
    a.check(w->hidden && w->hidden <= 1024 && w->context && w->context <= 1024);
    w->to_colour = a.real(9, true);
    for (int k = 0; k < LEVEL_SETS; k++) {
        read_context(a, w->contexts[k], w->context);
        read_synthesis(a, w->syntheses[k], w->hidden);
    }
    a.check(a.all());
    return w;
}

const Weights &Models::of(int number) {
    const Registration *entry = registration(number);
    std::unique_ptr<Weights> &weights = loaded[entry->file];
    if (!weights) {
        const void *bytes = nullptr;
        size_t count = 0;
        const auto function = find.function ? find.function : built_in;
        const bool there = !function(find.context, FILE_NAMES[entry->file], &bytes, &count) && bytes;
        supported(there, "PYR-35", "the weights of the model are not at hand");
        weights = read({(const uint8_t *)bytes, count});
    }
    return *weights;
}

}  // namespace pxi
