#include "raster.h"

#include <cmath>

#include "parallel.h"

namespace pxi {

static const int STEP_ORIGIN = 293;
static const int AROUND = 3;   // positions around a window that its synthesis depends on
static const int STRIP_MIN = 64, STRIP = 256;  // rows that a thread makes at once, which bounds memory

Raster::Raster(const Plan &plan, const Weights &weights, const Watch &watch)
    : plan(plan), weights(weights), watch(watch), grid(plan), latents(plan, weights, watch) {}

// Makes a window in strips of rows, on several threads; each strip costs some rows more.
template <class Make> void Raster::strips(Window part, Make make) const {
    const int threads = watch.threads;
    const int rows = std::clamp((part.rows() + threads - 1) / threads, STRIP_MIN, STRIP);
    parallel(threads, (part.rows() + rows - 1) / rows, [&](int64_t k) {
        const int top = part.top + (int)k * rows;
        make(Window{top, std::min(top + rows, part.bottom), part.left, part.right});
    });
}

Raster::Inputs Raster::inputs(int level, Window window) {
    const Window above = window.halved().grown(AROUND, grid.at(level + 1));
    const int32_t *high = latents.level(level + 1, above);
    return {high, low(level + 1, above)};
}

// Makes a window of planes above a level, or of the samples that they give by the weights of `matrix`:
// [rows][columns][3], with `line` numbers from a row to the next.
void Raster::finer(int level, const Inputs &from, Window window, const float *matrix, float *out, int64_t line) const {
    const Shape coarser = grid.at(level + 1);
    const Window above = window.halved().grown(AROUND, coarser), under = above.doubled(grid.at(level));
    const Window at = window.inside(under);
    const Synthetic &w = weights.synthesis_of(level + 1);
    const float t = (float)(plan.step - STEP_ORIGIN) / 128;
    std::vector<float> gain(9), bias = w.first_bias;
    for (int k = 0; k < 9; k++) gain[k] = (float)std::exp((double)(w.gain[k] + w.gain_by_step[k] * t));
    for (size_t i = 0; i < bias.size(); i++) bias[i] += w.first_by_step[i] * t;
    const Listening listening(watch);
    const int64_t wide = coarser.columns, start = above.top * wide + above.left;
    const loops::Synthesis task = {w.linear.data(), w.first.data(), bias.data(), w.second.data(),
                                   w.second_bias.data(), w.third.data(), w.third_bias.data(), gain.data(),
                                   weights.hidden, above.rows(), above.columns(), under.rows(), under.columns(),
                                   from.low + 3 * start, from.high + start, matrix, out, 3 * wide, wide,
                                   coarser.size(), line, at.top, at.bottom, at.left, at.right, listening.function()};
    check_core(core().pyramid_synthesis(&task), plan.at);
}

// Planes [h][w][3] above a level, of which a window is made.
const float *Raster::low(int level, Window window) {
    const Shape shape = grid.at(level);
    Level &own = lows[level];
    if (level == grid.levels) {
        if (own.planes) return own.planes.data();
        const std::vector<int32_t> &lowest = latents.lowest();
        own.planes.make((int64_t)lowest.size());
        for (int c = 0; c < 3; c++)
            for (int64_t i = 0; i < shape.size(); i++) own.planes[3 * i + c] = (float)lowest[c * shape.size() + i];
        return own.planes.data();
    }
    if (!own.planes) own.planes.make(3 * shape.size()), own.made = Made(shape);
    for (const Window &part : own.made.lacking(window)) {
        const Inputs from = inputs(level, part);
        strips(part, [&](Window strip) {
            float *out = own.planes.data() + 3 * (strip.top * (int64_t)shape.columns + strip.left);
            finer(level, from, strip, nullptr, out, 3 * (int64_t)shape.columns);
        });
        own.made.add(part);
    }
    return own.planes.data();
}

// Factors [3][3] that even planes take on by the linear part of a level.
static std::vector<double> evenly(const Synthetic &w) {
    std::vector<double> out(9);
    for (int output = 0; output < 12; output++)
        for (int plane = 0; plane < 3; plane++) {
            double sum = 0;
            for (int tap = 0; tap < 25; tap++) sum += w.linear[(output * 12 + plane) * 25 + tap];
            out[output / 4 * 3 + plane] += sum / 4;
        }
    return out;
}

// Weights [3][3] of planes above a level in colours of 0..255.
std::vector<float> Raster::matrix(int level) const {
    std::vector<float> out = weights.to_colour;
    for (int k = 1; k <= level; k++) {
        const std::vector<double> factors = evenly(weights.synthesis_of(k));
        std::vector<float> next(9);
        for (int i = 0; i < 9; i++) {
            double sum = 0;
            for (int j = 0; j < 3; j++) sum += out[i / 3 * 3 + j] * factors[3 * j + i % 3];
            next[i] = (float)sum;
        }
        out = next;
    }
    for (float &weight : out) weight *= (float)std::exp2(plan.step / 64.);
    return out;
}

// Samples of a window, whose planes begin at `planes`, both in rows of so many numbers.
void Raster::colour(const std::vector<float> &matrix, const float *planes, int64_t stride, float *out, int64_t line,
                    Shape at) const {
    const int components = plan.components;
    std::vector<float> row(3 * (size_t)at.columns);
    for (int y = 0; y < at.rows; y++, planes += stride, out += line) {
        core().coloured(planes, matrix.data(), at.columns, row.data());
        if (components == 3)
            for (size_t i = 0; i < row.size(); i++) out[i] = std::clamp(row[i] / 255, 0.f, 1.f);
        else
            for (int x = 0; x < at.columns; x++)
                out[x] = std::clamp((row[3 * x] + row[3 * x + 1] + row[3 * x + 2]) / 3 / 255, 0.f, 1.f);
    }
}

const float *Raster::samples(int level, Window window) {
    const Shape wanted = shape(level);
    Level &own = coloured[level];
    if (!own.planes) own.planes.make(wanted.size() * plan.components), own.made = Made(wanted);
    const std::vector<float> weights = matrix(level);
    for (const Window &part : own.made.lacking(window)) {
        const Inputs from = level ? Inputs{nullptr, low(level, part)} : inputs(0, part);
        const int64_t line = (int64_t)wanted.columns * plan.components;
        strips(part, [&](Window strip) {
            float *out = own.planes.data() + strip.top * line + strip.left * plan.components;
            const int64_t columns = level ? wanted.columns : strip.columns();
            if (level) {
                colour(weights, from.low + 3 * (strip.top * columns + strip.left), 3 * columns, out, line, strip.shape());
            } else if (plan.components == 3) {
                finer(0, from, strip, weights.data(), out, line);
            } else {
                const std::unique_ptr<float[]> planes(new float[3 * strip.shape().size()]);
                finer(0, from, strip, nullptr, planes.get(), 3 * columns);
                colour(weights, planes.get(), 3 * columns, out, line, strip.shape());
            }
        });
        own.made.add(part);
    }
    if (level == 0 && own.made.whole()) latents.forget();
    return own.planes.data();
}

}  // namespace pxi
