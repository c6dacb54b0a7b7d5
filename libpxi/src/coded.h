// Entropy-coded arrays and signed integers (chapter 4).
#pragma once

#include <vector>

#include "model.h"

namespace pxi {

// The head of a rANS stream (ENT-3 to ENT-7), and its words.
struct Stream {
    std::vector<uint32_t> states;
    std::vector<uint16_t> words;
    size_t size = 0;    // of the stream in bytes
    int64_t used = 0;   // words
    Place at;

    Stream(Bytes data, const Place &at);
    void reserve(int64_t symbols, int alphabet) const;  // refuses more than it can hold (SEC-7)
    void finish() const;                                // refuses what is left
};

// The size in bytes of the stream at the beginning of some data.
size_t stream_size(Bytes data, const Place &at);

// Values [channels][height][width] of 1 to 8 bits (ENT-1); 0 where `stored` [height][width], if it is
// not null, is 0.
std::vector<uint8_t> decode_array(Bytes data, int channels, int height, int width, int bits,
                                  const uint8_t *stored, const Place &at);

// A mask [height][width] that has a 1 and a 0 at least; otherwise `rule` is broken.
std::vector<uint8_t> decode_mask(Bytes data, int height, int width, const char *rule, const Place &at);

// Signed integers [channels][height][width] (ENT-17 to ENT-20).
std::vector<int32_t> decode_signed(Bytes classes, Bytes deltas, int channels, int height, int width, const Place &at);

// The bytes after a u32 length from `*next` on, which moves behind them.
Bytes take_array(Bytes data, size_t *next, const char *rule, const Place &at);

}  // namespace pxi
