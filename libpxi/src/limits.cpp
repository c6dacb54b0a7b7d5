#include "limits.h"

#include <algorithm>
#include <cstring>

#include "errors.h"

namespace pxi {

static const int64_t SMALL_FILE = 1 << 20;  // at most so many bytes: the stricter limits hold too

namespace {

struct Default {
    const char *name;
    int log2;
};
}  // namespace

static const Default DEFAULTS[LIMIT_COUNT] = {
    {"file_bytes", 30}, {"chunks", 16},        {"side", 20},           {"layers", 10},
    {"networks", 6},    {"segments", 16},      {"gates", 16},          {"small_gates", 15},
    {"faces", 18},      {"overlap", 6},        {"beyond", 28},         {"codes", 24},
    {"small_codes", 23}, {"samples", 26},      {"small_samples", 24},  {"filled", 27},
    {"covered", 31},    {"wavefronts", 17},    {"motion", 22},         {"parameters", 22},
    {"metadata_bytes", 26}, {"references", 20}, {"output_pixels", 28}, {"multiply_adds", 43},
    {"work", 28},
};

Limits::Limits() {
    for (int i = 0; i < LIMIT_COUNT; i++) at[i] = (int64_t)1 << DEFAULTS[i].log2;
}

const char *Limits::name(int limit) { return DEFAULTS[limit].name; }

int Limits::find(const char *name) {
    for (int i = 0; i < LIMIT_COUNT; i++)
        if (!std::strcmp(name, DEFAULTS[i].name)) return i;
    return -1;
}

// A number that is not negative, in decimal digits.
static std::string digits(int64_t value) {
    std::string out;
    do out.insert(out.begin(), (char)('0' + value % 10));
    while (value /= 10);
    return out;
}

void Budget::check(Limit limit, int64_t value) const {
    if (value <= limits.at[limit]) return;
    std::string message = Limits::name(limit);
    message += ": ", message += digits(value);
    message += " exceeds the limit of ", message += digits(limits.at[limit]);
    fail(Kind::LIMIT, "SEC-2", message.c_str());
}

void Budget::spend(Limit limit, int64_t amount) {
    const int64_t room = INT64_MAX - spent[limit];
    check(limit, spent[limit] + std::min(amount, room));
    spent[limit] += std::min(amount, room);
    if (spent[FILE_BYTES] == 0 || spent[FILE_BYTES] > SMALL_FILE) return;
    if (limit == GATES) check(SMALL_GATES, spent[limit]);
    if (limit == CODES) check(SMALL_CODES, spent[limit]);
    if (limit == SAMPLES) check(SMALL_SAMPLES, spent[limit]);
}

}  // namespace pxi
