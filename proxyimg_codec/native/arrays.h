// The adaptive array decoder of entropy/arrays.py, statement by statement; numpy is its judge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

struct Coded {  // a stream and where its symbols go
    const uint16_t *words;
    int64_t n_words;
    uint32_t *states;  // [lanes], left as they end
    int32_t lanes, channels, alphabet, width;
    const int32_t *y, *x;        // [positions], in coding order
    const int64_t *bounds;       // [waves + 1] first position of each wavefront
    int64_t waves;
    int32_t scale_bits, count_start, count_step, count_limit;
    int16_t *known;  // [(height + 1)][width + 2][channels], -1 = unknown
};

// Words used, or -1 where the stream ends too early.
static int64_t decode_symbols(const Coded &s) {
    const int A = s.alphabet, C = s.channels, contexts = A == 2 ? 16 : A + 1;
    const int64_t row = (int64_t)(s.width + 2) * C, total = 1 << s.scale_bits;
    std::vector<int32_t> counts((size_t)C * contexts * A, s.count_start);
    std::vector<int32_t> sums((size_t)C * contexts, s.count_start * A), rows, symbols;
    std::vector<int64_t> halved((size_t)C * contexts, -1);
    int64_t next = 0;
    for (int64_t w = 0; w < s.waves; w++) {
        rows.clear(), symbols.clear();
        int lane = 0;
        for (int64_t p = s.bounds[w]; p < s.bounds[w + 1]; p++)
            for (int c = 0; c < C; c++) {
                const int16_t *k = s.known + s.y[p] * row + (int64_t)s.x[p] * C + c;
                const int v[4] = {k[row], k[C], k[0], k[2 * C]};  // left, up, upper left, upper right
                int context = 0;
                if (A == 2) {
                    for (int i = 0; i < 4; i++) context += std::max(v[i], 0) << i;
                } else {
                    const int weight[4] = {2, 2, 1, 1};
                    int sum = 0, n = 0;
                    for (int i = 0; i < 4; i++)
                        if (v[i] >= 0) sum += weight[i] * v[i], n += weight[i];
                    context = n ? (2 * sum + n) / (2 * n) : A;
                }
                int r = c * contexts + context;
                const int32_t *count = counts.data() + (size_t)r * A;
                uint32_t &state = s.states[lane];
                int64_t slot = state & (total - 1), start = 0, freq = 0;
                int symbol = 0;
                for (;; symbol++, start += freq) {
                    freq = (total - A) * count[symbol] / sums[r] + 1;
                    if (symbol == A - 1) freq = total - start;
                    if (slot < start + freq) break;
                }
                uint64_t value = (uint64_t)freq * (state >> s.scale_bits) + slot - start;
                if (value < 65536) {
                    if (next == s.n_words) return -1;
                    value = value << 16 | s.words[next++];
                }
                state = (uint32_t)value;
                lane = lane + 1 == s.lanes ? 0 : lane + 1;
                rows.push_back(r), symbols.push_back(symbol);
            }
        size_t i = 0;
        for (int64_t p = s.bounds[w]; p < s.bounds[w + 1]; p++)
            for (int c = 0; c < C; c++, i++) {
                s.known[(s.y[p] + 1) * row + (int64_t)(s.x[p] + 1) * C + c] = (int16_t)symbols[i];
                counts[(size_t)rows[i] * A + symbols[i]] += s.count_step, sums[rows[i]] += s.count_step;
            }
        for (int r : rows)  // a row that comes again has been halved already
            if (sums[r] > s.count_limit && halved[r] != w) {
                halved[r] = w, sums[r] = 0;
                for (int a = 0; a < A; a++) {
                    int32_t &n = counts[(size_t)r * A + a];
                    sums[r] += n = (n + 1) >> 1;
                }
            }
    }
    return next;
}

}  // namespace PXI_LEVEL
