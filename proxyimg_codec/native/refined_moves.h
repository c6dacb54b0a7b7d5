// Moves of the latents of a level by one, where that lowers the cost; the judge is `moved` of
// encoder/pyramid/refine.py.
#pragma once

#include "refined_level.h"

namespace PXI_LEVEL {

struct Choosing {
    float share;      // of the best gain around, from which on a move is made
    float hesitation; // gain that a move needs to take back the last one
    float least;      // gain that any move needs
};

// For a row, what its moves gain, at `up`, and their directions, at `down`; of each position the best.
static inline void weigh(RefinedLevel &s, int y, const Choosing &how) {
    float *best = s.best(y, 0);
    std::fill_n(best, s.w, 0.f);
    for (int c = 0; c < 9; c++) {
        float *up = s.up(y, c), *down = s.down(y, c);
        for (int x = 0; x < s.w; x += LANES) {
            const vec slope = load(s.by_latents(y, c) + x), above = load(up + x) + slope, below = load(down + x) - slope;
            const vec change = chosen(above < below, all(1), all(-1)), last = load(s.last(y, c) + x);
            vec gain = -least(above, below);
            gain = chosen(gain > how.least, gain, (vec){});
            gain = chosen((last == -change) & (gain < how.hesitation), (vec){}, gain);
            if (s.may.channels) gain *= load(s.may(y, c) + x);
            store(up + x, gain), store(down + x, change);
            store(best + x, most(load(best + x), gain));
        }
    }
    s.best.trim(y);
}

// Makes the moves of a row that gain enough beside the best of 3 x 3 positions: of those that are close
// to each other, each would change what the others gain.
static inline void move(RefinedLevel &s, int y, const Choosing &how) {
    for (int x = 0; x < s.w; x += LANES) {
        vec enough = {};
        for (int r = std::max(y - 1, 0); r <= std::min(y + 1, s.h - 1); r++)
            for (int dx = -1; dx <= 1; dx++) enough = most(enough, load(s.best(r, 0) + x + dx));
        enough *= how.share;
        for (int c = 0; c < 9; c++) {
            const vec gain = load(s.up(y, c) + x), change = load(s.down(y, c) + x);
            const ints goes = (gain > 0.f) & (gain >= enough);
            float *to = s.latents(y, c) + x, *last = s.last(y, c) + x;
            store(to, load(to) + chosen(goes, change, (vec){}));
            store(last, chosen(goes, change, load(last)));
        }
    }
    s.latents.trim(y);
}

}  // namespace PXI_LEVEL
