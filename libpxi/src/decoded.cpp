// Networks of the file, planes of codes of implicit textures (chapter 7), and cells of views.
#include <bit>
#include <cmath>

#include "coded.h"
#include "core.h"
#include "read.h"

namespace pxi {

static const int FRACTION = 256;  // units of a code while it is filled (TEX-5)

// float16 numbers, finite and perhaps positive (TEX-3, TEX-16).
static std::vector<float> halves(Bytes data, int64_t count, bool positive, const char *rule, const Place &at) {
    need((int64_t)data.size() == 2 * count, rule, "the number of steps or biases is wrong", at);
    std::vector<float> out(count);
    for (int64_t i = 0; i < count; i++) {
        const int bits = data[2 * i] | data[2 * i + 1] << 8, exponent = bits >> 10 & 31, part = bits & 1023;
        need(exponent < 31, rule, "a step or bias is not finite", at);
        const float size = exponent ? std::ldexp(1024.f + part, exponent - 25) : std::ldexp((float)part, -24);
        need(!positive || (size > 0 && bits < 0x8000), rule, "a step is not positive", at);
        out[i] = bits & 0x8000 ? -size : size;
    }
    return out;
}

void decode_network(Netw &n) {
    const int64_t rows = (int64_t)n.depth * n.hidden + n.channels;
    const std::vector<float> steps = halves(n.steps, rows, true, "TEX-16", n.at);
    const std::vector<float> biases = halves(n.biases, rows, false, "TEX-16", n.at);
    const int zero = 1 << (n.bits - 1);
    size_t next = 0;
    int64_t row = 0;
    for (int layer = 0; layer <= n.depth; layer++) {
        const int inputs = layer ? n.hidden : n.dim * (2 * n.octaves + 1);
        const int outputs = layer < n.depth ? n.hidden : n.channels;
        const Bytes data = take_array(n.weights, &next, "TEX-15", n.at);
        const std::vector<uint8_t> values = decode_array(data, 1, outputs, inputs, n.bits, nullptr, n.at);
        for (size_t i = 0; i < values.size(); i++)
            n.values.push_back(steps[row + i / inputs] * (float)(values[i] - zero));
        n.values.insert(n.values.end(), biases.begin() + row, biases.begin() + row + outputs);
        row += outputs;
    }
    need(next == n.weights.size(), "TEX-15", "weights are left over", n.at);
}

void decode_codes(Texr &t, int dim) {
    const std::vector<float> steps = halves(t.steps, dim, true, "TEX-3", t.at);
    const int64_t size = (int64_t)t.rows * t.columns;
    std::vector<uint8_t> stored;
    if (!t.stored.empty()) stored = decode_mask(t.stored, t.rows, t.columns, "TEX-1", t.at);
    const uint8_t *known = stored.empty() ? nullptr : stored.data();
    const std::vector<uint8_t> codes = decode_array(t.codes, dim, t.rows, t.columns, t.bits, known, t.at);
    const int zero = 1 << (t.bits - 1);
    t.features.resize(size * dim);
    std::vector<int32_t> value(size);
    for (int f = 0; f < dim; f++) {
        for (int64_t i = 0; i < size; i++) value[i] = (codes[f * size + i] - zero) * FRACTION;
        if (known) {
            const loops::Plane plane = {1, t.rows, t.columns, value.data(), known};
            check_core(core().diffused(&plane, known), t.at);
        }
        const float scale = steps[f] / FRACTION;
        for (int64_t i = 0; i < size; i++) t.features[i * dim + f] = (float)value[i] * scale;
    }
}

void decode_cells(Texr &t) {
    const auto cells = [&](int size, int log2) { return (size + (1 << log2) - 1) >> log2; };
    if (!t.mask.empty())
        t.cells = decode_mask(t.mask, cells(t.part[3], t.cell), cells(t.part[2], t.cell), "PYR-39", t.at);
    if (t.sources.empty()) return;
    const int columns = cells(t.part[2], t.grain), rows = cells(t.part[3], t.grain);
    const int most = (int)t.offsets.size() / 2, bits = std::bit_width((unsigned)most);
    const int channels = bits <= 4 ? 1 : 2;
    t.copied = decode_array(t.sources, channels, rows, columns, channels == 1 ? bits : 4, nullptr, t.at);
    const size_t size = (size_t)rows * columns;
    for (size_t i = 0; channels == 2 && i < size; i++) t.copied[i] |= (uint8_t)(t.copied[size + i] << 4);
    t.copied.resize(size);
    bool any = false;
    for (const uint8_t source : t.copied) {
        need(source <= most, "PYR-48", "a source has no offset", t.at);
        any |= source;
    }
    need(any, "PYR-48", "all sources are 0", t.at);
}

}  // namespace pxi
