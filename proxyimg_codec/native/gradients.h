// Gradients of the network of an implicit texture, and of the pixels that its outputs make; torch is
// the judge.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "network.h"

// Rows of codes that are cleared and added together; features of a code; layers over a pixel, as in
// encoder/implicit/fit_problem.py.
static const int SPAN = 32, MAX_DIM = 64, MAX_OVER = 64;

namespace {

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

struct TrainingBlock : Block {  // the working memory of one thread that trains
    Buffer d_feature, d_encoded, d_a, d_b;
    explicit TrainingBlock(const Net &n)
        : Block(n), d_feature(n.dim * BLOCK), d_encoded(lay.encoded * BLOCK), d_a(width() * BLOCK),
          d_b(width() * BLOCK) {}

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

    // Adds the gradient of the features of n entries to that of the codes they come from.
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
double composite_loss(TrainingBlock &b, const float *coverage, const float *learn, const float *target,
                      int at, int n, float scale) {
    const int C = b.net.channels;
    const bool alpha = C == 4;
    float behind[MAX_OVER][4], through[MAX_OVER], out[4] = {0, 0, 0, 0};
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

}  // namespace
