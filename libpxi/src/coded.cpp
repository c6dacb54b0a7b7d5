#include "coded.h"

#include <algorithm>

#include "core.h"

namespace pxi {

static const uint32_t LOW = 65536;
static const int SCALE_BITS = 14, COUNT_START = 8, COUNT_STEP = 32, COUNT_LIMIT = 1 << 14, MODEL_BITS = 4;

static uint32_t u32(Bytes data, size_t at) {
    return data[at] | data[at + 1] << 8 | data[at + 2] << 16 | (uint32_t)data[at + 3] << 24;
}

size_t stream_size(Bytes data, const Place &at) {
    need(!data.empty() && data[0] <= 10, "ENT-4", "a stream has too many lanes, or none", at);
    const size_t head = 5 + ((size_t)4 << data[0]);
    need(data.size() >= head, "ENT-4", "a stream ends in its states", at);
    const uint64_t size = head + (uint64_t)2 * u32(data, head - 4);
    need(data.size() >= size, "ENT-4", "a stream ends in its words", at);
    return (size_t)size;
}

Stream::Stream(Bytes data, const Place &at) : size(stream_size(data, at)), at(at) {
    states.resize((size_t)1 << data[0]);
    for (size_t i = 0; i < states.size(); i++) {
        states[i] = u32(data, 1 + 4 * i);
        need(states[i] >= LOW, "ENT-5", "a state of a stream is too low", at);
    }
    const size_t head = 5 + 4 * states.size();
    words.resize((size - head) / 2);
    for (size_t i = 0; i < words.size(); i++)
        words[i] = (uint16_t)(data[head + 2 * i] | data[head + 2 * i + 1] << 8);
}

void Stream::reserve(int64_t symbols, int alphabet) const {
    const int64_t most = ((int64_t)words.size() + (int64_t)states.size()) << 18;
    need(symbols <= most / (alphabet - 1), "SEC-7", "a stream is too short for its symbols", at);
}

void Stream::finish() const {
    need(used == (int64_t)words.size(), "ENT-7", "a stream has words left over", at);
    for (const uint32_t state : states) need(state == LOW, "ENT-7", "a stream ends in wrong states", at);
}

namespace {

// Raw bits, most significant first (ENT-15, ENT-16).
class Bits {
    Bytes data;
    uint64_t next = 0;
    Place at;

  public:
    Bits(Bytes data, const Place &at) : data(data), at(at) {}
    uint32_t take(int count) {
        need(next + count <= 8 * (uint64_t)data.size(), "ENT-16", "raw bits end early", at);
        uint32_t value = 0;
        for (int i = 0; i < count; i++, next++) value = value << 1 | (data[next >> 3] >> (7 - (next & 7)) & 1);
        return value;
    }
    void finish() {
        const uint64_t rest = 8 * (uint64_t)data.size() - next;
        need(rest < 8 && take((int)rest) == 0, "ENT-16", "raw bits are left over", at);
    }
};

// Positions in the order of coding: by x + 2 y, within a wavefront by y.
struct Waves {
    std::vector<int32_t> y, x;
    std::vector<int64_t> bounds = {0};

    Waves(int height, int width, const uint8_t *stored, int64_t count) {
        y.reserve(count), x.reserve(count);
        for (int64_t t = 0; t < width + 2 * (int64_t)height - 2; t++) {
            const int64_t last = std::min<int64_t>(height - 1, t / 2);
            for (int64_t row = std::max<int64_t>(0, (t - width + 2) / 2); row <= last; row++) {
                const int64_t column = t - 2 * row;
                if (stored && !stored[row * width + column]) continue;
                y.push_back((int32_t)row), x.push_back((int32_t)column);
            }
            if ((int64_t)y.size() > bounds.back()) bounds.push_back((int64_t)y.size());
        }
    }
};

}  // namespace

std::vector<uint8_t> decode_array(Bytes data, int channels, int height, int width, int bits,
                                  const uint8_t *stored, const Place &at) {
    const int high = std::min(bits, MODEL_BITS), low = bits - high;
    const int64_t size = (int64_t)height * width;
    const int64_t count = stored ? size - std::count(stored, stored + size, 0) : size;
    Stream stream(data, at);
    stream.reserve(count * channels, 1 << high);
    const Waves waves(height, width, stored, count);
    const int64_t row = ((int64_t)width + 2) * channels;
    std::vector<int16_t> known((height + 1) * row, -1);
    const loops::Coded coded = {stream.words.data(), (int64_t)stream.words.size(), stream.states.data(),
                         (int32_t)stream.states.size(), channels, 1 << high, width,
                         waves.y.data(), waves.x.data(), waves.bounds.data(), (int64_t)waves.bounds.size() - 1,
                         SCALE_BITS, COUNT_START, COUNT_STEP, COUNT_LIMIT, known.data()};
    stream.used = core().decode(&coded);
    need(stream.used >= 0, "ENT-6", "a stream ends too early", at);
    stream.finish();
    Bits raw(data.subspan(stream.size), at);
    std::vector<uint8_t> out(size * channels);
    for (int c = 0; c < channels; c++)
        for (int64_t i = 0; i < size; i++) {
            if (stored && !stored[i]) continue;
            const int16_t symbol = known[(i / width + 1) * row + (i % width + 1) * channels + c];
            out[c * size + i] = (uint8_t)(symbol << low | (int)raw.take(low));
        }
    raw.finish();
    return out;
}

std::vector<uint8_t> decode_mask(Bytes data, int height, int width, const char *rule, const Place &at) {
    std::vector<uint8_t> mask = decode_array(data, 1, height, width, 1, nullptr, at);
    const size_t ones = std::count(mask.begin(), mask.end(), 1);
    need(ones && ones < mask.size(), rule, "a mask has only one value", at);
    return mask;
}

std::vector<int32_t> decode_signed(Bytes classes, Bytes deltas, int channels, int height, int width, const Place &at) {
    const std::vector<uint8_t> sizes = decode_array(classes, channels, height, width, 4, nullptr, at);
    Bits raw(deltas, at);
    std::vector<int32_t> out(sizes.size());
    for (size_t i = 0; i < sizes.size(); i++) {
        const int size = sizes[i];
        if (!size) continue;
        const bool negative = raw.take(1);
        int32_t value;
        if (size < 15) {
            value = (1 << (size - 1)) + (int32_t)raw.take(size - 1);
        } else {
            value = (int32_t)raw.take(31);
            need(value >= 1 << 14, "ENT-20", "a signed integer has the wrong class", at);
        }
        out[i] = negative ? -value : value;
    }
    raw.finish();
    return out;
}

Bytes take_array(Bytes data, size_t *next, const char *rule, const Place &at) {
    need(data.size() - *next >= 4, rule, "a length is missing", at);
    const uint32_t length = u32(data, *next);
    need(length <= data.size() - *next - 4, rule, "a coded array ends early", at);
    *next += 4 + (size_t)length;
    return data.subspan(*next - length, length);
}

}  // namespace pxi
