#include "values.h"

#include <algorithm>
#include <climits>
#include <cstring>

namespace pxi {

static const size_t ITEMS_MAX = 1 << 20;

Values::Values(Bytes payload, const Place &at, bool maps) : bytes(payload), at(at) {
    const int first = skip(1)[0];
    need(first >= 0x80 && first <= 0x9f, "CON-14", "the payload is no array of up to 15 values", at);
    map = first < 0x90, count = first & 15;
    if (!maps) refuse_map();
}

void Values::refuse_map() const { need(!map, "CON-14", "the payload is a map", at); }

Bytes Values::skip(size_t count) {
    need(count <= bytes.size() - next, "CON-14", "a value runs past the end of its payload", at);
    next += count;
    return bytes.subspan(next - count, count);
}

uint64_t Values::number(int size) {
    uint64_t value = 0;
    for (const uint8_t byte : skip(size)) value = value << 8 | byte;
    return value;
}

// A number of `size` bytes that does not fit half as many.
int64_t Values::unsigned_of(int size, uint64_t least) {
    const uint64_t value = number(size);
    need(value >= least, "CON-15", "a value is not in its shortest form", at);
    return (int64_t)std::min<uint64_t>(value, INT64_MAX);  // beyond every range
}

int64_t Values::signed_of(int size, int64_t most) {
    const int shift = 64 - 8 * size;
    const int64_t value = (int64_t)(number(size) << shift) >> shift;
    need(value < most, "CON-15", "a value is not in its shortest form", at);
    return value;
}

int64_t Values::any_integer() {
    const int first = skip(1)[0];
    if (first < 0x80) return first;
    if (first >= 0xe0) return first - 256;
    static const uint64_t LEAST[] = {128, 1u << 8, 1u << 16, (uint64_t)1 << 32};
    static const int64_t MOST[] = {-32, -(1 << 7), -(1 << 15), -((int64_t)1 << 31)};
    if (first >= 0xcc && first <= 0xcf) return unsigned_of(1 << (first - 0xcc), LEAST[first - 0xcc]);
    need(first >= 0xd0 && first <= 0xd3, "CHK-1", "a value is not an integer", at);
    return signed_of(1 << (first - 0xd0), MOST[first - 0xd0]);
}

// A length in the first byte, from `fix` on, or after it; a form that does not exist is -1.
size_t Values::length(int first, int fix, int fixed, int form8, int form16) {
    if (fixed && first >= fix && first < fix + fixed) return first - fix;
    const int form32 = form16 + 1;
    need(first == form8 || first == form16 || first == form32, "CHK-1", "a value has the wrong type", at);
    if (first == form8) return unsigned_of(1, fixed);
    if (first == form16) return unsigned_of(2, form8 < 0 ? fixed : 1 << 8);
    return unsigned_of(4, 1 << 16);
}

void Values::key(const char *name) {
    need(taken++ < count, "CON-14", "the payload has too few values", at);
    if (!map) return;
    const size_t size = length(skip(1)[0], 0xa0, 32, 0xd9, 0xda);
    const Bytes found = skip(size);
    need(size == std::strlen(name) && !std::memcmp(found.data(), name, size), "CON-17",
         "a key is not in its place", at);
}

void Values::within(bool ok, const char *name) const {
    if (!ok) fail(Kind::INVALID, "CHK-1", (std::string(name) + " is out of its range").c_str(), at);
}

int64_t Values::integer(const char *name, int64_t low, int64_t high) {
    key(name);
    return item(name, low, high);
}

size_t Values::items() {
    const size_t size = length(skip(1)[0], 0x90, 16, -1, 0xdc);
    need(size <= ITEMS_MAX, "CON-16", "an array is too long", at);
    need(size <= bytes.size() - next, "CON-14", "an array runs past the end of its payload", at);
    return size;
}

int64_t Values::item(const char *name, int64_t low, int64_t high) {
    const int64_t value = any_integer();
    within(value >= low && value <= high, name);
    return value;
}

std::vector<int> Values::integers(const char *name, int64_t low, int64_t high) {
    key(name);
    std::vector<int> out(items());
    for (int &value : out) value = (int)item(name, low, high);
    return out;
}

void Values::integers(const char *name, int64_t low, int64_t high, int *to, size_t exactly) {
    key(name);
    within(items() == exactly, name);
    for (size_t i = 0; i < exactly; i++) to[i] = (int)item(name, low, high);
}

void Values::wide(const char *name, int64_t low, int64_t high, int64_t *to, size_t exactly) {
    key(name);
    within(items() == exactly, name);
    for (size_t i = 0; i < exactly; i++) to[i] = item(name, low, high);
}

size_t Values::areas(const char *name, int64_t high) {
    key(name);
    const size_t count = items();
    for (size_t i = 0; i < count; i++) item(name, 0, high);
    return count;
}

Bytes Values::binary(const char *name) {
    key(name);
    return skip(length(skip(1)[0], 0, 0, 0xc4, 0xc5));
}

int64_t characters(Bytes text) {
    int64_t count = 0;
    for (size_t i = 0; i < text.size(); count++) {
        const int first = text[i];
        const int more = first < 0x80   ? 0
                         : first < 0xc2 ? -1
                         : first < 0xe0 ? 1
                         : first < 0xf0 ? 2
                         : first < 0xf5 ? 3
                                        : -1;
        if (more < 0 || i + more >= text.size()) return -1;
        int code = more ? first & (0x3f >> more) : first;
        for (int k = 1; k <= more; k++) {
            if ((text[i + k] & 0xc0) != 0x80) return -1;
            code = code << 6 | (text[i + k] & 0x3f);
        }
        const bool overlong = (more == 2 && code < 0x800) || (more == 3 && code < 0x10000);
        if (overlong || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return -1;
        i += 1 + more;
    }
    return count;
}

std::string Values::text(const char *name, int low, int high) {
    key(name);
    const Bytes found = skip(length(skip(1)[0], 0xa0, 32, 0xd9, 0xda));
    const int64_t count = characters(found);
    need(count >= 0, "CON-16", "a string is not UTF-8", at);
    within(count >= low && count <= high, name);
    return std::string(found.begin(), found.end());
}

void Values::end() {
    need(taken == count, "CON-14", "the payload has too many values", at);
    need(next == bytes.size(), "CON-14", "the payload goes on after its last value", at);
}

}  // namespace pxi
