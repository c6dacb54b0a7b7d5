// Fused kernel of the implicit texture coder: gather -> encode -> MLP, forward and training; and, in
// headers, the entropy decoder of arrays and the pyramid coder.
//
// numpy (render) and torch (training) do the same arithmetic; this file is the fast engine and is
// judged by them. Data is processed in blocks of BLOCK entries in structure-of-arrays layout
// [feature][entry], so that every inner loop runs along entries with full vectors.
//
// An *entry* is one layer's contribution to one pixel: four bilinear taps into the table of codes.
// Training is deterministic for any number of threads: a batch is cut into PARTS fixed slices with
// gradient buffers of their own, which are added in a fixed order.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

#include "decode.h"

// The widest vectors that the machine has: gcc makes poor code of wider ones. A tile of TILE x 2
// vectors of sums, two of inputs and a factor fill the registers.
#if defined(__AVX512F__)
static const int LANES = 16, TILE = 8;
#elif defined(__AVX__)
static const int LANES = 8, TILE = 4;
#else
static const int LANES = 4, TILE = 4;
#endif
typedef float vec __attribute__((vector_size(4 * LANES)));
typedef int32_t ints __attribute__((vector_size(4 * LANES)));
typedef float vec8 __attribute__((vector_size(32), aligned(4), may_alias));  // anywhere in memory

#include "pyramid.h"
#include "synthesis.h"
#include "sample.h"
#include "coverage.h"

static const int BLOCK = 256, NV = BLOCK / LANES, PARTS = 4, MAX_LAYERS = 10, SPAN = 32;
static const float PI = 3.14159265358979f;

extern "C" {
struct Net {  // shape of the decoder network; weights are [out][in] rows, then the biases, per layer
    int32_t dim, octaves, hidden, depth, channels;
};
struct Entries {  // taps of every entry: rows base, base+1, base+stride, base+stride+1 of the codes
    const int32_t *base, *stride;
    const float *fx, *fy;
};
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
}

namespace {

struct Layout {
    int in[MAX_LAYERS], out[MAX_LAYERS], weight[MAX_LAYERS], bias[MAX_LAYERS], row[MAX_LAYERS];
    int layers, encoded, total;
    explicit Layout(const Net &n) {
        layers = n.depth + 1;
        encoded = n.dim * (2 * n.octaves + 1);
        int offset = 0, rows = 0;
        for (int l = 0; l < layers; l++) {
            in[l] = l ? n.hidden : encoded;
            out[l] = l == n.depth ? n.channels : n.hidden;
            weight[l] = offset, bias[l] = offset + in[l] * out[l], row[l] = rows;
            offset = bias[l] + out[l], rows += out[l];
        }
        total = offset;
    }
};

struct Buffer {  // 64-byte aligned floats
    std::vector<float> store;
    float *p;
    explicit Buffer(size_t n) : store(n + 16) {
        p = (float *)(((uintptr_t)store.data() + 63) & ~(uintptr_t)63);
    }
    Buffer(const Buffer &) = delete;
};

// out[j] = bias[j] + sum_i w[j * ws + i * wi] * in[i], with `relu` negative ones replaced by 0.
// Takes R rows by two vectors at a time, and what rows are left R / 2 at a time.
template <int R = TILE>
void matmul(const float *w, int ws, int wi, const float *bias, bool relu, const vec *in, vec *out, int ni,
            int no) {
    for (; no >= R; no -= R, w += R * ws, bias += bias ? R : 0, out += R * NV)
        for (int c = 0; c < NV; c += 2) {
            vec a[R][2];
            // Without the pragmas gcc keeps the sums in memory.
#pragma GCC unroll 8
            for (int r = 0; r < R; r++) a[r][0] = a[r][1] = (vec){} + (bias ? bias[r] : 0.f);
            for (int i = 0; i < ni; i++) {
                const vec x = in[i * NV + c], y = in[i * NV + c + 1];
#pragma GCC unroll 8
                for (int r = 0; r < R; r++) {
                    const float s = w[r * ws + i * wi];
                    a[r][0] += s * x, a[r][1] += s * y;
                }
            }
#pragma GCC unroll 8
            for (int r = 0; r < R; r++)
                for (int k = 0; k < 2; k++)
                    out[r * NV + c + k] = relu ? (a[r][k] < 0 ? (vec){} : a[r][k]) : a[r][k];
        }
    if constexpr (R > 1)
        if (no) matmul<R / 2>(w, ws, wi, bias, relu, in, out, ni, no);
}

float sum(vec v) {
    float s = 0;
    for (int i = 0; i < LANES; i++) s += v[i];
    return s;
}

// dw[j][i] += sum over entries of d[j] * x[i]; db[j] += sum of d[j].
void outer(const vec *d, const vec *x, float *dw, float *db, int ni, int no) {
    for (int j = 0; j < no; j += 4) {
        int rows = std::min(4, no - j);
        for (int i = 0; i < ni; i += 4) {
            int cols = std::min(4, ni - i);
            vec a[4][4] = {};
            if (rows == 4 && cols == 4) {
                for (int c = 0; c < NV; c++) {
                    vec xx[4];
                    for (int s = 0; s < 4; s++) xx[s] = x[(i + s) * NV + c];
                    for (int r = 0; r < 4; r++) {
                        vec dd = d[(j + r) * NV + c];
                        for (int s = 0; s < 4; s++) a[r][s] += dd * xx[s];
                    }
                }
            } else {
                for (int r = 0; r < rows; r++)
                    for (int s = 0; s < cols; s++)
                        for (int c = 0; c < NV; c++) a[r][s] += d[(j + r) * NV + c] * x[(i + s) * NV + c];
            }
            for (int r = 0; r < rows; r++)
                for (int s = 0; s < cols; s++) dw[(j + r) * ni + i + s] += sum(a[r][s]);
        }
        for (int r = 0; r < rows; r++) {
            vec a = {};
            for (int c = 0; c < NV; c++) a += d[(j + r) * NV + c];
            db[j + r] += sum(a);
        }
    }
}

// sin(pi x) and cos(pi x): reduced to |r| <= 1/2, Taylor polynomials (error < 1e-7).
inline void sincospi(vec x, vec &s, vec &c) {
    // The largest number below 1/2, since adding 1/2 itself would round large odd numbers up.
    const vec half = (vec){} + .49999997f;
    const ints k = __builtin_convertvector(x + (x < 0 ? -half : half), ints);
    const vec r = (x - __builtin_convertvector(k, vec)) * PI, r2 = r * r;
    const vec sign = 1 - 2 * __builtin_convertvector(k & 1, vec);
    s = sign * r * (1 + r2 * (-1.f / 6 + r2 * (1.f / 120 + r2 * (-1.f / 5040 +
        r2 * (1.f / 362880 - r2 * (1.f / 39916800))))));
    c = sign * (1 + r2 * (-.5f + r2 * (1.f / 24 + r2 * (-1.f / 720 + r2 * (1.f / 40320 +
        r2 * (-1.f / 3628800 + r2 * (1.f / 479001600)))))));
}

// Gradients of one slice of a batch. Codes come in spans of SPAN rows, and only spans that were
// touched are cleared and added: batches are sorted, so a slice touches few of them.
struct Gradients {
    std::vector<float> codes, weights;
    std::vector<uint8_t> touched;
    double loss = 0;
    void touch(int64_t first, int64_t last) { touched[first / SPAN] = touched[last / SPAN] = 1; }
    void clear(int64_t width) {
        for (size_t s = 0; s < touched.size(); s++)
            if (touched[s]) std::fill_n(codes.begin() + s * width, width, 0.f), touched[s] = 0;
        std::fill(weights.begin(), weights.end(), 0.f);
        loss = 0;
    }
};

struct Block {  // the working memory of one thread
    const Net net;
    const Layout lay;
    Buffer feature, encoded, d_feature, d_encoded, acts, d_a, d_b;
    explicit Block(const Net &n)
        : net(n), lay(n), feature(n.dim * BLOCK), encoded(lay.encoded * BLOCK), d_feature(n.dim * BLOCK),
          d_encoded(lay.encoded * BLOCK), acts((size_t)lay.layers * width() * BLOCK),
          d_a(width() * BLOCK), d_b(width() * BLOCK) {}
    int width() const { return std::max(net.hidden, net.channels); }
    float *act(int l) { return acts.p + (size_t)l * width() * BLOCK; }
    float *output() { return act(lay.layers - 1); }

    void gather(const float *codes, const Entries &e, int64_t start, int n, const int32_t *index) {
        const int D = net.dim;
        for (int d = 0; d < D; d += 8)
            for (int p = 0; p < BLOCK; p++) {
                int64_t k = p < n ? (index ? index[p] : start + p) : (index ? index[0] : start);
                const float *a = codes + (int64_t)e.base[k] * D + d, *b = a + (int64_t)e.stride[k] * D;
                float x = e.fx[k], y = e.fy[k], w11 = x * y, w10 = x - w11, w01 = y - w11, w00 = 1 - x - w01;
                float *to = feature.p + d * BLOCK + p;
                if (d + 8 <= D) {
                    const vec8 f = w00 * *(vec8 *)a + w10 * *(vec8 *)(a + D) + w01 * *(vec8 *)b +
                                   w11 * *(vec8 *)(b + D);
                    for (int i = 0; i < 8; i++) to[i * BLOCK] = f[i];
                } else {
                    for (int i = 0; i < D - d; i++)
                        to[i * BLOCK] = w00 * a[i] + w10 * a[D + i] + w01 * b[i] + w11 * b[D + i];
                }
            }
    }

    // Feature by feature, which keeps few streams to memory at a time: those of the octaves lie
    // a power of two apart and would push each other out of the cache.
    void encode() {
        const int n = net.dim * NV;
        for (int d = 0; d < n; d += NV) {
            vec *to = (vec *)encoded.p + d, *s = to + n, *c = s + n;
            std::memcpy(to, (vec *)feature.p + d, NV * sizeof(vec));
            if (net.octaves)
                for (int v = 0; v < NV; v++) sincospi(to[v], s[v], c[v]);
            for (int k = 1; k < net.octaves; k++, s += 2 * n, c += 2 * n)
                for (int v = 0; v < NV; v++) {
                    const vec twice = 2 * s[v];
                    s[2 * n + v] = twice * c[v];
                    c[2 * n + v] = 1 - twice * s[v];
                }
        }
    }

    void forward(const float *weights) {
        encode();
        const float *in = encoded.p;
        for (int l = 0; l < lay.layers; l++) {
            float *out = act(l);
            matmul(weights + lay.weight[l], lay.in[l], 1, weights + lay.bias[l], l + 1 < lay.layers,
                   (const vec *)in, (vec *)out, lay.in[l], lay.out[l]);
            in = out;
        }
    }

    // d_a holds the gradient of the output; leaves the gradient of the features in d_feature.
    void backward(const float *weights, float *g_weights) {
        float *d = d_a.p, *next = d_b.p;
        for (int l = lay.layers - 1; l >= 0; l--) {
            const float *in = l ? act(l - 1) : encoded.p;
            outer((vec *)d, (const vec *)in, g_weights + lay.weight[l], g_weights + lay.bias[l], lay.in[l],
                  lay.out[l]);
            float *to = l ? next : d_encoded.p;
            matmul(weights + lay.weight[l], 1, lay.in[l], nullptr, false, (vec *)d, (vec *)to, lay.out[l],
                   lay.in[l]);
            if (l) {
                for (int i = 0; i < lay.in[l] * BLOCK; i++) to[i] = in[i] > 0 ? to[i] : 0.f;
                std::swap(d, next);
            }
        }
        const int n = net.dim * BLOCK;
        std::memcpy(d_feature.p, d_encoded.p, n * sizeof(float));
        float scale = PI;
        for (int k = 0; k < net.octaves; k++, scale *= 2) {
            const float *s = encoded.p + (2 * k + 1) * n, *c = s + n;
            const float *ds = d_encoded.p + (2 * k + 1) * n, *dc = ds + n;
            for (int i = 0; i < n; i++) d_feature.p[i] += scale * (ds[i] * c[i] - dc[i] * s[i]);
        }
    }

    void scatter(Gradients &g, const Entries &e, const int32_t *index, int n) {
        const int D = net.dim;
        for (int p = 0; p < n; p++) {
            int64_t k = index[p];
            g.touch(e.base[k], e.base[k] + 1);
            g.touch(e.base[k] + e.stride[k], e.base[k] + e.stride[k] + 1);
            float *a = g.codes.data() + (int64_t)e.base[k] * D, *b = a + (int64_t)e.stride[k] * D;
            float x = e.fx[k], y = e.fy[k], w11 = x * y, w10 = x - w11, w01 = y - w11, w00 = 1 - x - w01;
            for (int d = 0; d < D; d++) {
                float v = d_feature.p[d * BLOCK + p];
                a[d] += w00 * v, a[D + d] += w10 * v, b[d] += w01 * v, b[D + d] += w11 * v;
            }
        }
    }
};

// Composites the entries of one pixel and turns the squared error into gradients of the outputs.
// Back to front: R_k = c_k p_k + (1 - c_k a_k) R_{k+1}, with a_k = 1 where the file has no alpha.
double composite_loss(Block &b, const float *coverage, const float *learn, const float *target, int at,
                      int n, float scale) {
    const int C = b.net.channels;
    const bool alpha = C == 4;
    float behind[64][4], through[64], out[4] = {0, 0, 0, 0};
    float *o = b.output(), *d = b.d_a.p;
    auto opacity = [&](int k) {
        return coverage[k] * (alpha ? std::clamp(o[3 * BLOCK + at + k], 0.f, 1.f) : 1.f);
    };
    for (int k = n - 1; k >= 0; k--) {
        std::memcpy(behind[k], out, sizeof out);
        float keep = 1 - opacity(k);
        for (int c = 0; c < C; c++) out[c] = coverage[k] * o[c * BLOCK + at + k] + keep * out[c];
    }
    through[0] = 1;
    for (int k = 1; k < n; k++) through[k] = through[k - 1] * (1 - opacity(k - 1));
    double loss = 0;
    float g[4];
    for (int c = 0; c < C; c++) {
        float r = out[c] - target[c];
        loss += r * r;
        g[c] = r * scale;
    }
    for (int k = 0; k < n; k++) {
        float w = through[k] * coverage[k], hidden = 0;
        for (int c = 0; c < C; c++) {
            d[c * BLOCK + at + k] = w * g[c];
            hidden += g[c] * behind[k][c];
        }
        if (alpha) d[3 * BLOCK + at + k] -= w * hidden;
        for (int c = 0; c < C; c++) d[c * BLOCK + at + k] *= learn[k];
    }
    return loss;
}

void train_slice(const Train &t, Block &b, const float *codes, const float *weights, const int32_t *pixels,
                 int64_t n, float scale, Gradients &g) {
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

// Fading moments end as denormal numbers, which are a hundred times slower: treated as zero while
// this object lives, in this thread only.
struct FlushDenormals {
#if defined(__SSE__)
    unsigned mode = _mm_getcsr();
    FlushDenormals() { _mm_setcsr(mode | 0x8040); }
    ~FlushDenormals() { _mm_setcsr(mode); }
#endif
};

// Threads meet twice a step, every millisecond or less: sleeping at once would cost more than the
// work, spinning for long would take the processor from whoever else needs it.
class Barrier {
    std::atomic<int> waiting{0}, round{0};

  public:
    int threads = 1;
    void wait() {
        int now = round.load();
        if (waiting.fetch_add(1) + 1 == threads) {
            waiting.store(0);
            round.store(now + 1);
            round.notify_all();
            return;
        }
        for (int spins = 0; spins < 20000; spins++)
            if (round.load(std::memory_order_relaxed) != now) break;
        while (round.load() == now) round.wait(now);
    }
};

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

// Quantized copies that the forward pass reads (straight-through estimator: gradients go to the originals).
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

}  // namespace

extern "C" {

int64_t pxi_decode(const Coded *stream) { return decode_symbols(*stream); }

// Runs `steps` Adam steps; `pixels` is [steps][batch]. Returns the mean loss of the steps.
double pxi_train(const Train *task, const int32_t *pixels, int64_t steps, int64_t batch, int64_t done,
                 const float *lr_codes, const float *lr_weights) {
    const Train &t = *task;
    const Layout lay(t.net);
    const int64_t rows = t.n_codes, D = t.net.dim;
    const float scale = 2.f / (t.net.channels * batch);
    std::vector<float> q_codes(t.code_max ? rows * D : 0), q_weights(lay.total);
    Gradients parts[PARTS];
    const int64_t spans = (rows + SPAN - 1) / SPAN;
    for (auto &g : parts) {
        g.codes.resize(spans * SPAN * D), g.weights.resize(lay.total);
        g.touched.assign(spans, 0);
    }
    const float *codes = t.code_max ? q_codes.data() : t.codes;
    const float *weights = t.weight_max ? q_weights.data() : t.weights;
    if (t.code_max) quantize_codes(t, q_codes.data(), 0, rows);
    if (t.weight_max) quantize_weights(t, lay, q_weights.data());

    Barrier sync;
    std::atomic<bool> begun{false};
    double loss = 0;
    auto work = [&](int id) {
        begun.wait(false);
        const int threads = sync.threads;
        const FlushDenormals flush;
        Block block(t.net);
        for (int64_t s = 0; s < steps; s++) {
            const int32_t *px = pixels + s * batch;
            for (int p = id; p < PARTS; p += threads) {
                int64_t a = batch * p / PARTS, z = batch * (p + 1) / PARTS;
                train_slice(t, block, codes, weights, px + a, z - a, scale, parts[p]);
                add_prior(t, t.n_prior * p / PARTS, t.n_prior * (p + 1) / PARTS, parts[p]);
            }
            sync.wait();
            float step = (float)(done + s + 1);
            Rate rc{lr_codes[s], 1 / (1 - std::pow(.9f, step)), 1 / (1 - std::pow(.99f, step))}, rw = rc;
            rw.lr = lr_weights[s];
            for (int64_t span = spans * id / threads; span < spans * (id + 1) / threads; span++) {
                int64_t from = span * SPAN, to = std::min(from + SPAN, rows), n = (to - from) * D;
                float g[SPAN * 64] = {};
                for (auto &part : parts)
                    if (part.touched[span])
                        for (int64_t i = 0; i < n; i++) g[i] += part.codes[from * D + i];
                float *c = t.codes + from * D, *m = t.codes_m + from * D, *v = t.codes_v + from * D;
                for (int64_t i = 0; i < n; i++) c[i] = adam(c[i], g[i], m[i], v[i], rc);
                if (t.code_max) quantize_codes(t, q_codes.data(), from, to);
            }
            if (id == 0) {
                for (int i = 0; i < lay.total; i++) {
                    float g = parts[0].weights[i];
                    for (int p = 1; p < PARTS; p++) g += parts[p].weights[i];
                    t.weights[i] = adam(t.weights[i], g, t.weights_m[i], t.weights_v[i], rw);
                }
                for (auto &g : parts) loss += g.loss;
                if (t.weight_max) quantize_weights(t, lay, q_weights.data());
            }
            sync.wait();
        }
    };
    std::vector<std::thread> pool;
    try {
        for (int i = 1; i < std::min(t.threads, PARTS); i++) pool.emplace_back(work, i);
    } catch (const std::system_error &) {
        // No more threads to be had: those that there are do the work.
    }
    sync.threads = (int)pool.size() + 1;
    begun = true;
    begun.notify_all();
    work(0);
    for (auto &th : pool) th.join();
    return loss / ((double)t.net.channels * batch * std::max<int64_t>(steps, 1));
}

// Codes a level of a pyramid; what went wrong, if anything.
int pxi_pyramid_level(Level *level) {
    try {
        return LevelCoder(*level).run();
    } catch (const std::bad_alloc &) {
        return NO_MEMORY;
    }
}

// Synthesis of a level of a pyramid; what went wrong, if anything.
int pxi_pyramid_synthesis(const Synthesis *level) {
    try {
        Synthesizer(*level).run();
        return NOTHING;
    } catch (const std::bad_alloc &) {
        return NO_MEMORY;
    }
}

// Samples at points, see `sample`; `channels` is 3 or 4.
int pxi_coverage(Cover *to, const int64_t *segments, const int64_t *log2, int64_t n) {
    return coverage(*to, segments, log2, n);
}

void pxi_sample(const float *samples, int64_t stride, int32_t channels, const Points *at, float *out) {
    if (channels == 3)
        sample<3>(samples, stride, *at, out);
    else
        sample<4>(samples, stride, *at, out);
}

void pxi_blend(float *result, float *clear, const float *colour, const float *coverage, int64_t n) {
    blend(result, clear, colour, coverage, n);
}

// Words that encoding gives, at the back of `words`; see `rans_encode`.
int64_t pxi_rans_encode(const uint16_t *start, const uint16_t *freq, const int64_t *ends, int64_t groups,
                        int32_t scale_bits, int32_t lanes, uint32_t *states, uint16_t *words) {
    return rans_encode(start, freq, ends, groups, scale_bits, lanes, states, words);
}

// Network output of `n` entries: out is [n][channels].
void pxi_forward(const Net *net, const float *codes, const float *weights, const Entries *entries, int64_t n,
                 float *out) {
    Block block(*net);
    for (int64_t a = 0; a < n; a += BLOCK) {
        int count = (int)std::min<int64_t>(BLOCK, n - a);
        block.gather(codes, *entries, a, count, nullptr);
        block.forward(weights);
        for (int p = 0; p < count; p++)
            for (int c = 0; c < net->channels; c++)
                out[(a + p) * net->channels + c] = block.output()[c * BLOCK + p];
    }
}
}
