// Entropy coding of the pyramid's latents: entropy/laplace.py, entropy/rans.py and the coders of
// texture/latents.py, statement by statement; numpy is their judge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "level.h"

namespace PXI_LEVEL {

struct Tables {  // of entropy/laplace.py
    const uint16_t *ends;   // [rows][columns] cumulative frequencies
    const int64_t *reach;   // [rows]
    const int64_t *shifts;  // [scales]
    int32_t columns, scales, certain, limit, scale_bits;
};
struct Source {  // what is decoded from: the stream as it stands, and the list of escapes
    const uint16_t *words;
    uint32_t *states;
    const uint8_t *escapes;
    int64_t n_words, used, n_escapes, escapes_used;
    int32_t lanes;
};
struct Sink {  // what is encoded: symbols in groups, and the differences that escape
    uint16_t *start, *freq;
    int64_t *ends;  // [groups] symbols up to the end of each
    int64_t *escapes;
    int64_t n_symbols, n_groups, n_escapes;
};

enum Wrong { NOTHING, STREAM_ENDS, ESCAPES_END, OUT_OF_RANGE, NO_MEMORY, STOPPED };

struct Symbol {  // a latent and where it is found in the tables
    int32_t row, centre, shift, low;  // row < 0: certainly 0
    int64_t value;
};

struct LatentCoder {
    const Tables &t;
    Source &source;
    Sink &sink;

    Symbol located(int mean, int scale) const {
        const int shift = (int)t.shifts[scale], index = scale - (11 * shift + 1) / 2;
        if (shift > 0) mean = (mean >> shift) - 8 + (8 >> shift);
        const int centre = (mean + 8) >> 4, part = mean - 16 * centre + 8;
        const bool certain = scale <= t.certain && mean >= -4 && mean <= 4;
        return {certain ? -1 : index * 16 + part, centre, shift, 0, 0};
    }

    // Finds the values of symbols.
    Wrong decode(std::vector<Symbol> &symbols) {
        int lane = 0;
        const uint32_t mask = (1u << t.scale_bits) - 1;
        for (Symbol &s : symbols) {
            if (s.row < 0) continue;
            const uint16_t *ends = t.ends + (int64_t)s.row * t.columns;
            const uint32_t state = source.states[lane];
            const uint32_t slot = state & mask;
            const int found = passed(ends + 1, 2 * (int)t.reach[s.row] + 1, (int16_t)slot);
            const uint32_t freq = ends[found + 1] - ends[found];
            if (!advance(lane, freq * (state >> t.scale_bits) + slot - ends[found])) return STREAM_ENDS;
            s.value = found;
        }
        lane = 0;
        for (Symbol &s : symbols) {
            if (s.row < 0 || !s.shift) continue;
            const int rest = t.scale_bits - s.shift;
            const uint32_t state = source.states[lane], slot = state & mask;
            s.low = (int32_t)(slot >> rest);
            if (!advance(lane, ((state >> t.scale_bits) << rest) + slot - ((uint32_t)s.low << rest)))
                return STREAM_ENDS;
        }
        for (Symbol &s : symbols) {
            if (s.row < 0) continue;
            const int64_t reach = t.reach[s.row];
            s.value -= reach;
            if (s.value > reach && !escape(s.value)) return ESCAPES_END;
            s.value = (s.value + s.centre) * (1 << s.shift) + s.low;
            if (std::abs(s.value) >= t.limit) return OUT_OF_RANGE;
        }
        return NOTHING;
    }

    // Puts the values of symbols.
    void encode(const std::vector<Symbol> &symbols) {
        for (const Symbol &s : symbols) {
            if (s.row < 0) continue;
            const int64_t off = (s.value >> s.shift) - s.centre, reach = t.reach[s.row];
            const bool far = std::abs(off) > reach;
            if (far) sink.escapes[sink.n_escapes++] = off;
            const uint16_t *ends = t.ends + (int64_t)s.row * t.columns + (far ? 2 * reach + 1 : off + reach);
            put(ends[0], ends[1] - ends[0]);
        }
        end_group();
        for (const Symbol &s : symbols)
            if (s.row >= 0 && s.shift) {
                const int rest = t.scale_bits - s.shift;
                put((int)(s.value & ((1 << s.shift) - 1)) << rest, 1 << rest);
            }
        end_group();
    }

  private:
    // How many of the first `count` ends do not exceed a slot. Those behind them exceed every slot: so all are
    // compared that a few vectors hold.
    static int passed(const uint16_t *ends, int count, int16_t slot) {
        typedef int16_t sixteen __attribute__((vector_size(32)));
        typedef int8_t bytes __attribute__((vector_size(16)));
        const uint64_t ones = ~(uint64_t)0 / 255;
        int found = 0;
        for (int i = 0; i < count; i += 16) {
            sixteen v;
            std::memcpy(&v, ends + i, sizeof v);
            const bytes below = __builtin_convertvector(v <= slot, bytes);
            uint64_t parts[2];
            std::memcpy(parts, &below, sizeof below);
            found += (int)((((parts[0] & ones) + (parts[1] & ones)) * ones) >> 56);
        }
        return found;
    }
    // A new state of a lane, which is refilled where it ran low; false where the stream ends.
    bool advance(int &lane, uint32_t state) {
        if (state < 65536) {
            if (source.used == source.n_words) return false;
            state = state << 16 | source.words[source.used++];
        }
        source.states[lane] = state;
        lane = lane + 1 == source.lanes ? 0 : lane + 1;
        return true;
    }
    bool escape(int64_t &value) {
        int64_t n = 0;
        for (int shift = 0;; shift += 7) {
            if (source.escapes_used == source.n_escapes || shift > 21) return false;
            const int byte = source.escapes[source.escapes_used++];
            n |= (int64_t)(byte & 127) << shift;
            if (byte < 128) break;
        }
        value = n & 1 ? -((n + 1) / 2) : n / 2;
        return true;
    }
    void put(int start, int freq) {
        sink.start[sink.n_symbols] = (uint16_t)start;
        sink.freq[sink.n_symbols++] = (uint16_t)freq;
    }
    void end_group() {
        if (sink.n_symbols > (sink.n_groups ? sink.ends[sink.n_groups - 1] : 0))
            sink.ends[sink.n_groups++] = sink.n_symbols;
    }
};

// The stream of symbols in groups that end at `ends`: words go to the back of words[n symbols].
// Returns how many.
static int64_t rans_encode(const uint16_t *start, const uint16_t *freq, const int64_t *ends, int64_t groups,
                           int scale_bits, int lanes, uint32_t *states, uint16_t *words) {
    const int64_t n = groups ? ends[groups - 1] : 0;
    int64_t next = n;
    for (int64_t g = groups - 1; g >= 0; g--) {
        const int64_t first = g ? ends[g - 1] : 0;
        for (int64_t i = ends[g] - 1; i >= first; i--) {
            uint32_t x = states[(i - first) & (lanes - 1)];
            if (x >= (uint64_t)freq[i] << (32 - scale_bits)) words[--next] = (uint16_t)x, x >>= 16;
            states[(i - first) & (lanes - 1)] = ((x / freq[i]) << scale_bits) + x % freq[i] + start[i];
        }
    }
    return n - next;
}

}  // namespace PXI_LEVEL
