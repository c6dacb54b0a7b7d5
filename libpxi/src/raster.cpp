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

// Makes planes above a level, [rows][columns][3] of a window that holds the one that is asked for.
Raster::Planes Raster::finer(int level, const Inputs &from, Window window, Window *under) const {
    const Shape coarser = grid.at(level + 1);
    const Window above = window.halved().grown(AROUND, coarser);
    *under = above.doubled(grid.at(level));
    const std::vector<int32_t> high = cut(from.high, 9, coarser, above);
    std::vector<float> part;  // unless the rows are whole
    if (above.columns() < coarser.columns) part = cut(from.low, 1, coarser, above, 3);
    const float *planes = part.empty() ? from.low + 3 * (int64_t)above.top * coarser.columns : part.data();
    const Synthetic &w = weights.synthesis_of(level + 1);
    const float t = (float)(plan.step - STEP_ORIGIN) / 128;
    std::vector<float> gain(9), bias = w.first_bias;
    Planes out(new float[3 * under->shape().size()]);
    for (int k = 0; k < 9; k++) gain[k] = (float)std::exp((double)(w.gain[k] + w.gain_by_step[k] * t));
    for (size_t i = 0; i < bias.size(); i++) bias[i] += w.first_by_step[i] * t;
    const loops::Synthesis task = {w.linear.data(), w.first.data(), bias.data(), w.second.data(),
                                   w.second_bias.data(), w.third.data(), w.third_bias.data(), gain.data(),
                                   weights.hidden, above.rows(), above.columns(), under->rows(), under->columns(),
                                   planes, high.data(), out.get(), watch.function, watch.user};
    check_core(core().pyramid_synthesis(&task), plan.at);
    return out;
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
            Window under;
            const Planes found = finer(level, from, strip, &under);
            paste(found.get(), under.shape(), strip.inside(under), own.planes.data(), shape, strip, 1, 3);
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

// Samples of a window, whose planes begin at `planes`, in rows of `stride` numbers.
void Raster::colour(const std::vector<float> &matrix, const float *planes, int64_t stride, float *out, Shape shape,
                    Window at) const {
    std::vector<float> row(plan.components == 1 ? 3 * (size_t)at.columns() : 0);  // whose mean is grey
    for (int y = at.top; y < at.bottom; y++, planes += stride) {
        float *to = out + ((int64_t)y * shape.columns + at.left) * plan.components;
        if (row.empty()) {
            core().shown(planes, matrix.data(), at.columns(), to);
            continue;
        }
        core().coloured(planes, matrix.data(), at.columns(), row.data());
        for (int x = 0; x < at.columns(); x++)
            to[x] = std::clamp((row[3 * x] + row[3 * x + 1] + row[3 * x + 2]) / 3 / 255, 0.f, 1.f);
    }
}

// Makes a strip of samples of the whole raster from what the level above gives.
void Raster::draw(const std::vector<float> &weights, const Inputs &from, Window strip) {
    const Shape wanted = shape(0);
    Window under;
    const Planes found = finer(0, from, strip, &under);
    const Window at = strip.inside(under);
    const int64_t stride = 3 * (int64_t)under.columns();
    colour(weights, found.get() + at.top * stride + 3 * at.left, stride, coloured[0].planes.data(), wanted, strip);
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
            const float *planes = low(level, part);
            const int64_t stride = 3 * (int64_t)wanted.columns;
            colour(weights, planes + part.top * stride + 3 * part.left, stride, own.planes.data(), wanted, part);
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
