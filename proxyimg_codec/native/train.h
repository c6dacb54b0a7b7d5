// Training of an implicit texture: Adam on codes and weights that are rounded as the file rounds them;
// torch, encoder/implicit/fit_torch.py, is the judge.
//
// It is deterministic for any number of threads: a batch is cut into PARTS fixed slices with gradient
// buffers of their own, which are added in a fixed order.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <system_error>
#include <thread>
#include <vector>

#include "gradients.h"
#include "threads.h"

using namespace PXI_LEVEL;

static const int PARTS = 4;

struct Train {
    Net net;
    Entries entries;
    int64_t n_codes;
    const int32_t *first;     // [pixels + 1] range of entries of each pixel, front to back
    const float *coverage;    // [entries]
    const float *learn;       // [entries] factor of the entry's gradient
    const float *target;      // [pixels][channels], premultiplied
    float *codes, *codes_m, *codes_v;      // [n_codes][dim] and Adam moments
    float *weights, *weights_m, *weights_v;
    const int32_t *prior_row;     // [n_prior] codes with a smoothness prior
    const int32_t *prior_next;    // [n_prior][4] their neighbours
    const float *prior_weight;    // [n_prior]
    int64_t n_prior;
    const uint8_t *plane;     // [n_codes] which row of code_steps
    const float *code_steps;  // [planes][dim]; used when code_max > 0
    const float *row_steps;   // one per output row of the network
    int32_t code_max, weight_max;  // symbols lie in -max-1 .. max; 0 switches quantization off
    int32_t threads;
};

namespace {

// Gradients of n pixels.
void train_slice(const Train &t, TrainingBlock &b, const float *codes, const float *weights,
                 const int32_t *pixels, int64_t n, float scale, Gradients &g) {
    g.clear((int64_t)SPAN * t.net.dim);
    int32_t index[BLOCK];
    for (int64_t i = 0; i < n;) {
        int filled = 0;
        int64_t j = i;
        for (; j < n; j++) {
            int32_t a = t.first[pixels[j]], z = t.first[pixels[j] + 1];
            if (filled + z - a > BLOCK) break;
            for (int32_t k = a; k < z; k++) index[filled++] = k;
        }
        b.gather(codes, t.entries, 0, filled, index);
        b.forward(weights);
        std::memset(b.d_a.p, 0, sizeof(float) * t.net.channels * BLOCK);
        for (int at = 0; i < j; i++) {
            int32_t a = t.first[pixels[i]], count = t.first[pixels[i] + 1] - a;
            g.loss += composite_loss(b, t.coverage + a, t.learn + a,
                                     t.target + (int64_t)pixels[i] * t.net.channels, at, count, scale);
            at += count;
        }
        b.backward(weights, g.weights.data());
        b.scatter(g, t.entries, index, filled);
    }
}

// Gradient of weight / 2 * |code - mean of its neighbours|^2, the mean taken as given.
void add_prior(const Train &t, int64_t from, int64_t to, Gradients &g) {
    const int D = t.net.dim;
    for (int64_t k = from; k < to; k++) {
        const int32_t *next = t.prior_next + 4 * k;
        int64_t row = (int64_t)t.prior_row[k] * D;
        g.touch(t.prior_row[k], t.prior_row[k]);
        for (int d = 0; d < D; d++) {
            float sum = 0;
            for (int n = 0; n < 4; n++) sum += t.codes[(int64_t)next[n] * D + d];
            g.codes[row + d] += t.prior_weight[k] * (t.codes[row + d] - sum / 4);
        }
    }
}

struct Rate {
    float lr, c1, c2;
};

inline float adam(float p, float g, float &m, float &v, const Rate &r) {
    const float b1 = .9f, b2 = .99f, eps = 1e-8f;
    m = b1 * m + (1 - b1) * g;
    v = b2 * v + (1 - b2) * g * g;
    return p - r.lr * (m * r.c1) / (std::sqrt(v * r.c2) + eps);
}

inline float round_to(float x, float step, float top) {
    return std::clamp(nearbyintf(x / step), -top - 1, top) * step;
}

// Quantized copies that the forward pass reads (straight-through estimator: gradients go to the
// originals).
void quantize_codes(const Train &t, float *out, int64_t from, int64_t to) {
    const int D = t.net.dim;
    for (int64_t i = from; i < to; i++) {
        const float *step = t.code_steps + t.plane[i] * D;
        for (int d = 0; d < D; d++) {
            // Kept near the range, so that a clamped code can come back.
            float low = -(t.code_max + 1.5f) * step[d], high = (t.code_max + .5f) * step[d];
            float &code = t.codes[i * D + d];
            code = std::clamp(code, low, high);
            out[i * D + d] = round_to(code, step[d], t.code_max);
        }
    }
}

void quantize_weights(const Train &t, const Layout &lay, float *out) {
    std::memcpy(out, t.weights, lay.total * sizeof(float));
    for (int l = 0; l < lay.layers; l++)
        for (int j = 0; j < lay.out[l]; j++)
            for (int i = 0; i < lay.in[l]; i++) {
                int k = lay.weight[l] + j * lay.in[l] + i;
                out[k] = round_to(t.weights[k], t.row_steps[lay.row[l] + j], t.weight_max);
            }
}

struct Steps {  // of Adam
    const int32_t *pixels;  // [count][batch]
    int64_t count, batch, done;  // done: steps that were taken before
    const float *lr_codes, *lr_weights;  // [count]
};

class Training {
    const Train &t;
    const Steps steps;
    const Layout lay;
    const int64_t rows, D, spans;
    const float scale;
    std::vector<float> q_codes, q_weights;
    const float *codes, *weights;  // what the forward pass reads
    Gradients parts[PARTS];
    volatile double loss = 0;  // volatile: added in this order, in spite of -ffast-math
    Barrier sync;
    std::atomic<bool> begun{false};

    Rate rate(const float *lr, int64_t s) const {
        const float step = (float)(steps.done + s + 1);
        return {lr[s], 1 / (1 - std::pow(.9f, step)), 1 / (1 - std::pow(.99f, step))};
    }

    // The gradients of one part of a batch.
    void fill_part(TrainingBlock &block, const int32_t *pixels, int p) {
        const int64_t a = steps.batch * p / PARTS, z = steps.batch * (p + 1) / PARTS;
        train_slice(t, block, codes, weights, pixels + a, z - a, scale, parts[p]);
        add_prior(t, t.n_prior * p / PARTS, t.n_prior * (p + 1) / PARTS, parts[p]);
    }

    // Adds the parts' gradients of a span of codes, and moves the codes.
    void step_codes(int64_t span, const Rate &r) {
        const int64_t from = span * SPAN, to = std::min(from + SPAN, rows), n = (to - from) * D;
        float g[SPAN * MAX_DIM] = {};
        for (auto &part : parts)
            if (part.touched[span])
                for (int64_t i = 0; i < n; i++) g[i] += part.codes[from * D + i];
        float *c = t.codes + from * D, *m = t.codes_m + from * D, *v = t.codes_v + from * D;
        for (int64_t i = 0; i < n; i++) c[i] = adam(c[i], g[i], m[i], v[i], r);
        if (t.code_max) quantize_codes(t, q_codes.data(), from, to);
    }

    void step_weights(const Rate &r) {
        for (int i = 0; i < lay.total; i++) {
            float g = parts[0].weights[i];
            for (int p = 1; p < PARTS; p++) g += parts[p].weights[i];
            t.weights[i] = adam(t.weights[i], g, t.weights_m[i], t.weights_v[i], r);
        }
        if (t.weight_max) quantize_weights(t, lay, q_weights.data());
    }

    // The share of one thread.
    void work(int id) {
        begun.wait(false);
        const int threads = sync.threads;
        const FlushDenormals flush;
        TrainingBlock block(t.net);
        for (int64_t s = 0; s < steps.count; s++) {
            for (int p = id; p < PARTS; p += threads) fill_part(block, steps.pixels + s * steps.batch, p);
            sync.wait();
            const Rate r = rate(steps.lr_codes, s);
            for (int64_t span = spans * id / threads; span < spans * (id + 1) / threads; span++)
                step_codes(span, r);
            if (id == 0) {
                step_weights(rate(steps.lr_weights, s));
                for (auto &g : parts) loss = loss + g.loss;
            }
            sync.wait();
        }
    }

  public:
    Training(const Train &task, const Steps &steps)
        : t(task), steps(steps), lay(t.net), rows(t.n_codes), D(t.net.dim), spans((rows + SPAN - 1) / SPAN),
          scale(2.f / (t.net.channels * steps.batch)), q_codes(t.code_max ? rows * D : 0),
          q_weights(lay.total), codes(t.code_max ? q_codes.data() : t.codes),
          weights(t.weight_max ? q_weights.data() : t.weights) {
        for (auto &g : parts) {
            g.codes.resize(spans * SPAN * D), g.weights.resize(lay.total);
            g.touched.assign(spans, 0);
        }
        if (t.code_max) quantize_codes(t, q_codes.data(), 0, rows);
        if (t.weight_max) quantize_weights(t, lay, q_weights.data());
    }

    // Takes the steps; returns their mean loss.
    double run() {
        std::vector<std::thread> pool;
        try {
            for (int i = 1; i < std::min(t.threads, PARTS); i++) pool.emplace_back(&Training::work, this, i);
        } catch (const std::system_error &) {
            // No more threads to be had: those that there are do the work.
        }
        sync.threads = (int)pool.size() + 1;
        begun = true;
        begun.notify_all();
        work(0);
        for (auto &th : pool) th.join();
        return loss / ((double)t.net.channels * steps.batch * std::max<int64_t>(steps.count, 1));
    }
};

}  // namespace
