// Values of a payload: canonical MessagePack (CON-14 to CON-18), read one after the other.
#pragma once

#include <string>
#include <vector>

#include "model.h"

namespace pxi {

// Characters of well-formed UTF-8, or -1.
int64_t characters(Bytes text);

class Values {
    Bytes bytes;
    Place at;
    size_t next = 0;
    bool map = false;
    int count = 0, taken = 0;

    uint64_t number(int size);  // big-endian
    int64_t unsigned_of(int size, uint64_t least);
    int64_t signed_of(int size, int64_t most);
    size_t length(int first, int fix, int fixed, int form8, int form16);
    Bytes skip(size_t count);
    int64_t any_integer();
    int64_t item(const char *name, int64_t low, int64_t high);
    void key(const char *name);
    void within(bool ok, const char *name) const;
    size_t items();

  public:
    // `maps`: whether the payload may be a map from keys, as in early versions (CON-17).
    Values(Bytes payload, const Place &at, bool maps);
    void refuse_map() const;  // which is not allowed after all

    // The next value, which has this key and lies in this range.
    int64_t integer(const char *name, int64_t low, int64_t high);
    std::vector<int> integers(const char *name, int64_t low, int64_t high);
    void integers(const char *name, int64_t low, int64_t high, int *to, size_t exactly);
    void wide(const char *name, int64_t low, int64_t high, int64_t *to, size_t exactly);
    size_t areas(const char *name, int64_t high);  // of an array of 0 .. high, how many there are
    Bytes binary(const char *name);
    std::string text(const char *name, int low, int high);
    void end();  // there is nothing else
};

}  // namespace pxi
