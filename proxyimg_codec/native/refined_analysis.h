// The analysis of a level for the encoder; the judge is encoder/pyramid/model.py, `Level.analyse`.
#pragma once

#include "refined_context.h"
#include "team.h"

namespace PXI_LEVEL {

struct Analysis {
    const float *linear, *in, *in_bias, *between, *between_bias, *out, *out_bias;  // [out][in][taps]
    int32_t hidden, rows, columns, threads;
    const float *planes;  // [3][rows][columns]
    float *found;         // [12][(rows + 1) / 2][(columns + 1) / 2] coarser planes, then bands
};

struct AnalysisSums {
    Sum in, between, out;  // out: of the network and the wavelet
    explicit AnalysisSums(const Analysis &s)
        : in(ContextSums::forward({s.in, s.hidden, 12, 9}, s.in_bias)),
          between(ContextSums::forward({s.between, s.hidden, s.hidden, 1}, s.between_bias)),
          out(12, s.hidden * 9 + 12 * 25, s.out_bias) {
        out.set(0, s.out, s.hidden, 9), out.set(s.hidden * 9, s.linear, 12, 25);
    }
};

class Analyser {
    const Analysis &s;
    const AnalysisSums &sums;
    const int n, h, w;
    Floats wide, inputs, first, second;
    Terms in;

    static int reflected(int i, int n) {
        const int period = std::max(2 * n - 2, 1), at = (i % period + period) % period;
        return at < n ? at : period - at;
    }
    // Row y of cells of 2 x 2 samples, with those that are mirrored.
    void read(int y) {
        for (int c = 0; c < 3; c++)
            for (int k = 0; k < 4; k++) {
                const float *from = s.planes + ((int64_t)c * s.rows + reflected(2 * y + k / 2, s.rows)) * s.columns;
                float *to = wide(y, 4 * c + k);
                for (int x = 0; x < w - 1; x++) to[x] = from[2 * x + k % 2];
                for (int x : {-2, -1, w - 1, w, w + 1}) to[x] = from[reflected(2 * x + k % 2, s.columns)];
            }
        if (y < 0 || y >= h) return inputs.clear(y);
        for (int c = 0; c < 3; c++)
            for (int x = 0; x < w; x += LANES) {
                vec mean = {};
                for (int k = 0; k < 4; k++) mean += load(wide(y, 4 * c + k) + x) * .25f;
                for (int k = 0; k < 4; k++)
                    store(inputs(y, 4 * c + k) + x, bounded(load(wide(y, 4 * c + k) + x) - mean, 8));
            }
        inputs.trim(y);
    }
    void hide(int y) {
        if (y < 0 || y >= h) return second.clear(y);
        in.clear(), square_terms(in, inputs, 0, 12, y, 1);
        sums.in(in.data(), w, [&](int o, int x, vec v) { store(first(0, o) + x, most(v, (vec){})); });
        in.clear(), row_terms(in, first, 0, 0, n);
        sums.between(in.data(), w, [&](int o, int x, vec v) { store(second(y, o) + x, most(v, (vec){})); });
        second.trim(y);
    }
    void find(int y) {
        in.clear(), square_terms(in, second, 0, n, y, 1), square_terms(in, wide, 0, 12, y, 2);
        sums.out(in.data(), w, [&](int o, int x, vec v) {
            std::memcpy(s.found + ((int64_t)o * h + y) * w + x, &v, std::min(LANES, w - x) * sizeof(float));
        });
    }

  public:
    Analyser(const Analysis &task, const AnalysisSums &sums)
        : s(task), sums(sums), n(s.hidden), h((s.rows + 1) / 2), w((s.columns + 1) / 2), wide(12, w, 5),
          inputs(12, w, 3), first(n, w, 1), second(n, w, 3) {}

    void run(int from, int to) {
        for (int t = from - 2; t < to + 2; t++) {
            read(t);
            if (t - 1 >= from - 1) hide(t - 1);
            if (t - 2 >= from) find(t - 2);
        }
    }

    static void all(const Analysis &task) {
        const AnalysisSums sums(task);
        const int strip = 32, h = (task.rows + 1) / 2;
        Team(task.threads).run((h + strip - 1) / strip, [&](int i) {
            Analyser(task, sums).run(i * strip, std::min((i + 1) * strip, h));
        });
    }
};

}  // namespace PXI_LEVEL
