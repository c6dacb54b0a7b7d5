// Chapter 10: how the nodes of layers move over time.
#pragma once

#include "pose.h"

namespace pxi {

class Motion {
    const Motn &motn;
    int span, total = 0;             // coefficients of a curve; nodes of all layers
    std::vector<int> nodes;          // of each layer
    std::vector<int32_t> curves;     // [modes][layers][span]
    std::vector<int32_t> shapes;     // [x, y][modes][nodes of all layers]

  public:
    // Decodes and checks the trajectory. `motn` must outlive it; `meshes` are those of all layers.
    Motion(const Motn &motn, const std::vector<Refined> &meshes, Budget &budget);

    // Displacements of the nodes of all `layers`, x0, y0, .. in 1/1024 pixel (MOT-7); none of those that do not move.
    std::vector<Points> at(int64_t microseconds, size_t layers) const;
};

}  // namespace pxi
