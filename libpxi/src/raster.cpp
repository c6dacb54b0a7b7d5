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
    const int64_t wide = coarser.columns, start = above.top * wide + above.left;
    const loops::Synthesis task = {w.linear.data(), w.first.data(), bias.data(), w.second.data(),
                                   w.second_bias.data(), w.third.data(), w.third_bias.data(), gain.data(),
                                   weights.hidden, above.rows(), above.columns(), under.rows(), under.columns(),
                                   from.low + 3 * start, from.high + start, matrix, out, 3 * wide, wide,
                                   coarser.size(), line, at.top, at.bottom, at.left, at.right,
                                   watch.function, watch.user};
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
    std::vector<float> row(plan.components == 1 ? 3 * (size_t)at.columns : 0);  // whose mean is grey
    for (int y = 0; y < at.rows; y++, planes += stride, out += line) {
        if (row.empty()) {
            core().shown(planes, matrix.data(), at.columns, out);
            continue;
        }
        core().coloured(planes, matrix.data(), at.columns, row.data());
        for (int x = 0; x < at.columns; x++)
            out[x] = std::clamp((row[3 * x] + row[3 * x + 1] + row[3 * x + 2]) / 3 / 255, 0.f, 1.f);
    }
}

// Makes a strip of samples of the whole raster from what the level above gives.
void Raster::draw(const std::vector<float> &weights, const Inputs &from, Window strip) {
    const int64_t line = (int64_t)plan.width * plan.components;
    float *out = coloured[0].planes.data() + strip.top * line + strip.left * plan.components;
    if (plan.components == 3) return finer(0, from, strip, weights.data(), out, line);
    const int64_t stride = 3 * (int64_t)strip.columns();
    const std::unique_ptr<float[]> planes(new float[strip.rows() * stride]);
    finer(0, from, strip, nullptr, planes.get(), stride);
    colour(weights, planes.get(), stride, out, line, strip.shape());
}

#ifndef PXI_NO_THREADS
// Makes a part of the raster while its latents are decoded.
void Raster::flow(const std::vector<float> &weights, Window part) {
    const Shape above = grid.at(1);
    const Window under = part.halved().grown(AROUND, above);
    latents.prepare(1);
    low(grid.levels, {});
    Arrival planes(above, watch), high(above, watch);
    const float *lows = nullptr;
    const int count = (part.rows() + STRIP_MIN - 1) / STRIP_MIN;
    parallel(watch.threads, 2 + count, [&](int64_t k) {
        if (k == 0) return high.during([&] { latents.read_into(1, high); });
        if (k == 1) return planes.during([&] { lows = low(1, under); });
        const int top = part.top + (int)(k - 2) * STRIP_MIN;
        const Window strip = {top, std::min(top + STRIP_MIN, part.bottom), part.left, part.right};
        if (!planes.wait(above.rows) || !high.wait(strip.halved().grown(AROUND, above).bottom)) return;
        draw(weights, {high.latents(), lows}, strip);
    });
}
#endif

const float *Raster::samples(int level, Window window) {
    const Shape wanted = shape(level);
    Level &own = coloured[level];
    if (!own.planes) own.planes.make(wanted.size() * plan.components), own.made = Made(wanted);
    const std::vector<float> weights = matrix(level);
    for (const Window &part : own.made.lacking(window)) {
        if (level) {
            const int64_t line = (int64_t)wanted.columns * plan.components, stride = 3 * (int64_t)wanted.columns;
            colour(weights, low(level, part) + part.top * stride + 3 * part.left, stride,
                   own.planes.data() + part.top * line + part.left * plan.components, line, part.shape());
#ifndef PXI_NO_THREADS
        } else if (watch.threads > 1 && latents.flows(1)) {
            flow(weights, part);
#endif
        } else {
            const Inputs from = inputs(0, part);
            strips(part, [&](Window strip) { draw(weights, from, strip); });
        }
        own.made.add(part);
    }
    if (level == 0 && own.made.whole()) latents.forget();
    return own.planes.data();
}

}  // namespace pxi
