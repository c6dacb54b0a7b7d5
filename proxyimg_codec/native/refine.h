// Refinement of the latents of a pyramid by moves of one; the judge is encoder/pyramid/refine.py.
//
// An evaluation goes from the coarsest level to the finest, and its gradient back. Rows of all layers of a
// network are made one after the other, while those before are still in the cache, by threads that take
// strips of rows; sums are kept by row, so that results do not depend on the number of threads.
#pragma once

#include <memory>

#include "refined_moves.h"
#include "refined_synthesis.h"
#include "refined_wavelet.h"
#include "team.h"

namespace PXI_LEVEL {

struct Refine {
    const RefinedWeights *weights;      // [levels], from the finest
    float *const *latents;              // [levels + 1]: [9][h][w], then the lowest planes [3][h][w]; whole numbers
    const float *const *support;        // of the same shapes, 0 where latents are 0, else 1; or null
    const uint8_t *const *free;         // of the same shapes, 1 where latents may change; or null
    const float *picture;               // [3][rows][columns] in 0..255
    const float *weight;                // [rows][columns]; or null
    const float *const *bends;          // [levels + 1]: [3][h][w], then [1][h][w], of curvature.py; or null in tally
    const float *colour;                // [3][3]
    const float *axis;                  // [2][2][5]
    int32_t levels, rows, columns, rounds, threads;
    int32_t done;                       // rounds that were made before
    int32_t sure;                       // rounds that lower the cost, so that it is not computed
    int32_t ramp;                       // rounds after which only the best moves around are made
    float step, price, share, hesitation;  // as in refine.py
    float *const *slopes;               // of the same shapes as the latents
    double *cost;                       // [2] error and bits, or [levels][2][16] bits by shift
    int (*watch)(void *listener, int done, int all);  // stops the work by a 1
    void *listener;
};

class Refiner {
    static constexpr int STRIP = 32;  // rows, even
    static constexpr float LEAST = 1e-3f;

    const Refine &s;
    Team team;
    std::vector<RefinedLevel> levels;
    std::vector<std::unique_ptr<ContextSums>> contexts;
    std::vector<std::unique_ptr<SynthesisSums>> syntheses;
    Wanted wanted;
    Axis axis;
    std::vector<std::vector<double>> bits;  // of each row of each level
    std::vector<double> errors;

    static int strips(int h) { return (h + STRIP - 1) / STRIP; }
    RefinedLevel *coarser(int k) { return k + 1 < s.levels ? &levels[k + 1] : nullptr; }

    void prepare() {
        int rows = s.rows, columns = s.columns;
        levels.reserve(s.levels);
        for (int k = 0; k < s.levels; k++) {
            levels.emplace_back(s.weights[k], rows, columns);
            contexts.push_back(std::make_unique<ContextSums>(s.weights[k]));
            syntheses.push_back(std::make_unique<SynthesisSums>(s.weights[k]));
            RefinedLevel &level = levels.back();
            bits.emplace_back(level.h);
            copy_in(s.latents[k], level.latents);
            if (s.support) level.support = Floats(9, level.w, level.h), copy_in(s.support[k], level.support);
            if (s.support || s.free) restrict(k);
            if (s.bends) copy_in(s.bends[k], level.bends);
            rows = level.h, columns = level.w;
        }
        errors.resize(levels[0].h);
        copy_in(s.latents[s.levels], levels.back().plain);
        std::copy_n(s.axis, 20, &axis.taps[0][0][0]);
    }
    static void copy_in(const float *from, Floats &to) {
        for (int c = 0; c < to.channels; c++)
            for (int y = 0; y < to.count; y++, from += to.width) std::copy_n(from, to.width, to(y, c));
    }
    void restrict(int k) {
        RefinedLevel &level = levels[k];
        level.may = s.support ? level.support : Floats(9, level.w, level.h);
        const uint8_t *free = s.free ? s.free[k] : nullptr;
        for (int c = 0; c < 9; c++)
            for (int y = 0; y < level.h; y++)
                for (int x = 0; x < level.w; x++) {
                    float &to = level.may(y, c)[x];
                    to = (!s.support || to != 0) && (!free || *free);
                    free += free != nullptr;
                }
    }
    static void copy_out(const Floats &from, float *to) {
        for (int c = 0; c < from.channels; c++)
            for (int y = 0; y < from.count; y++, to += from.width) std::copy_n(from(y, c), from.width, to);
    }
    void want() {
        RefinedLevel &level = levels[0];
        wanted = {Floats(12, level.w, level.h), Floats(4, level.w, level.h), {}, s.step};
        std::copy_n(s.colour, 9, wanted.colour);
        for (int y = 0; y < s.rows; y++)
            for (int x = 0; x < s.columns; x++) {
                const int k = y % 2 * 2 + x % 2;
                const int64_t at = (int64_t)y * s.columns + x;
                for (int i = 0; i < 3; i++)
                    wanted.picture(y / 2, 4 * i + k)[x / 2] = s.picture[i * (int64_t)s.rows * s.columns + at] / s.step;
                wanted.weight(y / 2, k)[x / 2] = s.weight ? s.weight[at] : 1;
            }
    }
    void mark_busy(RefinedLevel &level) {
        for (int y = 0; y < level.h; y++) {
            uint8_t *to = level.busy(y);
            std::fill_n(to, level.w, 0);
            for (int c = 0; c < 9; c++)
                for (int x = 0; x < level.w; x++) to[x] |= level.latents(y, c)[x] != 0;
        }
    }

    void forward() {
        levels.back().low = levels.back().plain;
        for (int k = s.levels - 1; k >= 0; k--) {
            RefinedLevel &level = levels[k];
            mark_busy(level);
            const int first = k ? 3 : 0;
            team.run(first + strips(level.h), [&](int i) {
                if (i < first) return PlainWavelet(level, levels[k - 1].plain, axis, i).forward();
                const int from = (i - first) * STRIP, to = std::min(from + STRIP, level.h);
                ContextForward(level, *contexts[k], coarser(k), s.price).run(from, to, bits[k].data());
                SynthesisForward(level, *syntheses[k])
                    .run(from, to, k ? &levels[k - 1].low : nullptr, wanted, errors.data());
            });
        }
    }
    void backward() {
        for (RefinedLevel &level : levels) level.by_latents.clear(), level.by_plain.clear();
        for (int k = 0; k < s.levels; k++) {
            RefinedLevel &level = levels[k];
            team.run(strips(level.h), [&](int i) {
                const int from = i * STRIP, to = std::min(from + STRIP, level.h);
                ContextBackward(level, *contexts[k], coarser(k)).run(from, to);
                SynthesisBackward(level, *syntheses[k]).run(from, to);
            });
            team.run(strips(level.h), [&](int i) {
                const int from = i * STRIP, to = std::min(from + STRIP, level.h);
                SynthesisBackward(level, *syntheses[k]).fold(from, to);
                std::vector<float> row(level.w);
                for (int y = from; y < to; y++)
                    for (int c = 0; c < 3; c++) {
                        high_pass(level.by_inputs[0], c, y, level.h, row.data());
                        for (int x = 0; x < level.w; x++) level.by_plain(y, c)[x] += row[x];
                    }
            });
            if (RefinedLevel *next = coarser(k))
                team.run(6, [&](int i) {
                    if (i < 3) return PlainWavelet(*next, level.plain, axis, i).back(level.by_plain);
                    gather(level.by_low, next->cells, i - 3);
                });
        }
    }
    // Slopes by the samples that the next coarser level gives.
    static void gather(const Floats &finer, Floats &cells, int c) {
        for (int y = 0; y < finer.count; y++)
            for (int x = 0; x < finer.width; x++) cells(y / 2, 4 * c + y % 2 * 2 + x % 2)[x / 2] = finer(y, c)[x];
    }

    double error() const {
        double sum = 0;
        for (double v : errors) sum += v;
        return sum;
    }
    double spent() const {
        double sum = 0;
        for (auto &level : bits)
            for (double v : level) sum += v;
        return sum;
    }
    // Moves, of which only the first round takes all that gain about half as much as the best around.
    void move_latents(int turn) {
        const Choosing how = {s.share + (1 - s.share) * std::min(turn / (float)s.ramp, 1.f), s.hesitation, LEAST};
        for (RefinedLevel &level : levels) {
            for (const auto step : {weigh, move})
                team.run(strips(level.h), [&](int i) {
                    for (int y = i * STRIP; y < std::min((i + 1) * STRIP, level.h); y++) step(level, y, how);
                });
        }
        if (turn == 0) settle();
    }
    // The analysis rounds the lowest planes one by one, which a smooth border may show: they move too, once,
    // as if all their values were equally cheap.
    void settle() {
        RefinedLevel &level = levels.back();
        for (int c = 0; c < 3; c++)
            for (int y = 0; y < level.h; y++)
                for (int x = 0; x < level.w; x++) {
                    const int64_t at = ((int64_t)c * level.h + y) * level.w + x;
                    const float slope = level.by_low(y, c)[x] + level.by_plain(y, c)[x];
                    const float bend = s.bends[s.levels][(int64_t)y * level.w + x];
                    if (std::abs(slope) <= bend + LEAST || (x + y) % 2) continue;  // none beside each other
                    if (s.support && s.support[s.levels][at] == 0) continue;
                    if (s.free && !s.free[s.levels][at]) continue;
                    level.plain(y, c)[x] -= slope > 0 ? 1 : -1;
                }
    }

    std::vector<Floats> best;  // of each level, then the lowest planes

    void keep() {
        best.resize(s.levels + 1);
        for (int k = 0; k < s.levels; k++) best[k] = levels[k].latents;
        best.back() = levels.back().plain;
    }

  public:
    explicit Refiner(const Refine &task) : s(task), team(task.threads) {
        const FlushDenormals flush;
        prepare();
    }

    // Moves latents; the best of all rounds take the place of those given.
    void run() {
        const FlushDenormals flush;
        want();
        double lowest = INFINITY;
        for (int turn = 0;; turn++) {
            if (turn && turn == s.rounds && s.done + turn < s.sure) {
                keep();
                if (s.watch) s.watch(s.listener, turn, s.rounds);
                break;
            }
            forward();
            const double total = error() + s.price * spent();
            if (total < lowest) lowest = total, keep();
            if ((s.watch && s.watch(s.listener, turn, s.rounds)) || turn == s.rounds) break;
            backward();
            move_latents(s.done + turn);
        }
        for (int k = 0; k <= s.levels; k++) copy_out(best[k], s.latents[k]);
    }

    // Bits of some of the latents of each level under each shift of the scales, which those given are.
    void tally() {
        const FlushDenormals flush;
        const int row = 2 * ContextForward::SHIFTS;
        for (int k = s.levels - 1; k >= 0; k--) {
            RefinedLevel &level = levels[k];
            mark_busy(level);
            std::vector<double> bits((size_t)level.h * row);
            const int first = k ? 3 : 0;
            team.run(first + strips(level.h), [&](int i) {
                if (i < first) return PlainWavelet(level, levels[k - 1].plain, axis, i).forward();
                const int from = (i - first) * STRIP, to = std::min(from + STRIP, level.h);
                ContextForward(level, *contexts[k], coarser(k), s.price).tally(from, to, bits.data());
            });
            for (size_t i = 0; i < bits.size(); i++) s.cost[k * row + i % row] += bits[i];
        }
    }

    // Cost of the latents, and its slopes but for those by a latent's own bits.
    void derive() {
        const FlushDenormals flush;
        want(), forward(), backward();
        s.cost[0] = error(), s.cost[1] = spent();
        for (int k = 0; k < s.levels; k++) copy_out(levels[k].by_latents, s.slopes[k]);
        RefinedLevel &last = levels.back();
        for (int y = 0; y < last.h; y++)
            for (int c = 0; c < 3; c++)
                for (int x = 0; x < last.w; x++) last.by_low(y, c)[x] += last.by_plain(y, c)[x];
        copy_out(last.by_low, s.slopes[s.levels]);
    }
};

}  // namespace PXI_LEVEL
