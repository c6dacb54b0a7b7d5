// Rows of inputs of the networks of a level, from 3 planes and 9 bands.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

// Whether one of nine bands, [9][size], is not 0 at each of n positions from `start` on.
inline void find_busy(const int32_t *bands, int64_t size, int64_t start, int n, uint8_t *busy) {
    for (int from = 0; from < n; from += 64) {
        int32_t some[64] = {};
        const int count = std::min(n - from, 64);
        for (int c = 0; c < 9; c++) {
            const int32_t *band = bands + c * size + start + from;
            for (int x = 0; x < count; x++) some[x] |= band[x];
        }
        for (int x = 0; x < count; x++) busy[from + x] = some[x] != 0;
    }
}

// The last `side` rows of something. There is room for as many more, so that they seldom move.
template <class Number> class Rows {
    const int side;
    const int64_t length;
    int top = 0;
    std::vector<Number> store;  // [2 side][length]

  public:
    Rows(int side, int64_t length, Number value = {}) : side(side), length(length), store(2 * side * length, value) {}
    Number *operator[](int r) { return store.data() + (top + r) * length; }
    void up() {  // the last row is to be written anew
        if (top == side) std::copy_n((*this)[1], (side - 1) * length, store.data());
        top = top == side ? 0 : top + 1;
    }
};

// Rows of 3 planes and 9 bands around a position. Where all the bands are 0, as in most windows of most
// pictures, the planes alone give the same sums; they have PLANES numbers a position.
template <class Number, int PLANES> struct Window {
    const int side, length;            // side rows of length positions
    Rows<Number> all, planes;          // [side][length][12], [side][length][PLANES]
    Rows<uint8_t> busy;                // [side][length] whether a band is not 0
    std::vector<uint8_t> any;          // [length] of any row
    std::vector<int32_t> loud, quiet;  // positions with such bands in their window, and the others

    Window(int side, int length, Number zero = 0)
        : side(side), length(length), all(side, length * 12, zero), planes(side, length * PLANES, zero),
          busy(side, length), any(length), loud(length), quiet(length) {}
    void up() { all.up(), planes.up(), busy.up(); }
    void filled(int r) {  // the planes of a row of `all`
        const Number *from = all[r];
        Number *to = planes[r];
        for (int x = 0; x < length; x++, from += 12, to += PLANES) std::copy_n(from, 3, to);
    }
    // Calls out(x, first output, Sums) of a layer of all, or of one of planes, for positions from .. end - 1.
    template <class L, class Out> void operator()(const L &of_all, const L &of_planes, int from, int end, Out out) {
        std::fill(any.begin(), any.end(), 0);
        for (int r = 0; r < side; r++)
            for (int x = 0; x < length; x++) any[x] |= busy[r][x];
        int some = 0, none = 0;
        for (int x = from; x < end; x++) {
            uint8_t near = 0;
            for (int k = 0; k < side; k++) near |= any[x + k];
            loud[some] = quiet[none] = x;
            some += near, none += !near;
        }
        of_all(some, [&](int i) { return all[0] + 12 * loud[i]; },
               [&](int i, int o, typename L::Sums v) { out(loud[i], o, v); });
        of_planes(none, [&](int i) { return planes[0] + PLANES * quiet[i]; },
                  [&](int i, int o, typename L::Sums v) { out(quiet[i], o, v); });
    }
};

}  // namespace PXI_LEVEL
