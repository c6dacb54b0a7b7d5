// Chapter 10: how the nodes of layers move over time.
#pragma once

#include <map>

#include "pose.h"

namespace pxi {

class Motion {
    const Motn &motn;
    int span, total = 0;             // coefficients of a curve; nodes of all layers
    std::vector<int> nodes;          // of each layer
    std::vector<int32_t> curves;     // [modes][layers][span]
    std::vector<int32_t> shapes;     // [x, y][modes][nodes of all layers]

  public:
    // Decodes and checks the trajectory. `motn` must outlive it.
    Motion(const Motn &motn, const std::map<int, Refined> &meshes, Budget &budget);

    // Displacements of the nodes of each layer that moves, x0, y0, .. in 1/1024 pixel (MOT-7).
    std::map<int, Points> at(int64_t microseconds) const;
};

}  // namespace pxi
