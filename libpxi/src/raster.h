// Samples of a raster, made as far as they are asked for (PYR-30 to PYR-34).
#pragma once

#include "latents.h"

namespace pxi {

class Raster {
    const Plan &plan;
    const Weights &weights;
    const Watch &watch;
    const Grid grid;
    Latents latents;
    struct Level {
        Zeros<float> planes;  // [h][w][3]
        Made made;
    };
    ByLevel<Level> lows;      // planes above a level
    ByLevel<Level> coloured;  // samples [h][w][components] without so many levels

    // Planes of a level [9][h][w] and [h][w][3], which give the next finer planes.
    struct Inputs {
        const int32_t *high;
        const float *low;
    };
    Inputs inputs(int level, Window window);
    void finer(int level, const Inputs &from, Window window, const float *matrix, float *out, int64_t line) const;
    const float *low(int level, Window window);
    template <class Make> void strips(Window part, Make make) const;
    std::vector<float> matrix(int level) const;
    void colour(const std::vector<float> &matrix, const float *planes, int64_t stride, float *out, int64_t line,
                Shape at) const;
    void draw(const std::vector<float> &weights, const Inputs &from, Window strip);
    void flow(const std::vector<float> &weights, Window part);

  public:
    Raster(const Plan &plan, const Weights &weights, const Watch &watch);
    Shape shape(int level) const { return level ? grid.at(level) : Shape{plan.height, plan.width}; }
    // Samples 0..1 [h][w][components] without the `level` finest levels; those in the window are made.
    const float *samples(int level, Window window);
};

}  // namespace pxi
