// Limits (SEC-2), and what a file, or a picture that is drawn, has spent of them.
#pragma once

#include <array>
#include <cstdint>

namespace pxi {

enum Limit {
    FILE_BYTES, CHUNKS, SIDE, LAYERS, NETWORKS, SEGMENTS, GATES, SMALL_GATES, FACES, OVERLAP, BEYOND, CODES,
    SMALL_CODES, SAMPLES, SMALL_SAMPLES, FILLED, COVERED, WAVEFRONTS, MOTION, PARAMETERS, METADATA_BYTES,
    REFERENCES, OUTPUT_PIXELS, MULTIPLY_ADDS, WORK,
    LIMIT_COUNT,
};

// What a sample of a layer, or of a face, counts as in multiplications; and a feature of an anchor
// for each sample.
constexpr int64_t SAMPLE_COST = 1 << 10, ANCHOR_COST = 1 << 7;

struct Limits {
    std::array<int64_t, LIMIT_COUNT> at;
    Limits();  // the defaults
    static const char *name(int limit);          // "file_bytes"
    static int find(const char *name);           // -1 if there is none
};

// Raises a Failure where something exceeds a limit. One budget for reading a file, and one for each
// picture that is drawn (`Budget(of the file)` has the same limits with nothing spent).
class Budget {
    int64_t spent[LIMIT_COUNT] = {};

  public:
    Limits limits;
    explicit Budget(const Limits &limits = {}) : limits(limits) {}
    void check(Limit limit, int64_t value) const;  // of `value` alone
    void spend(Limit limit, int64_t amount);       // amount >= 0
    int64_t left(Limit limit) const { return limits.at[limit] - spent[limit]; }
};

}  // namespace pxi
