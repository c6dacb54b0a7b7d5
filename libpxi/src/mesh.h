// Chapter 6, "Base" and "Refinement": the proxy nodes of a layer at rest.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "limits.h"
#include "model.h"

namespace pxi {

typedef std::array<int32_t, 3> Face;

struct Refined {
    std::vector<int64_t> nodes;  // x0, y0, x1, y1, .. in 1/1024 canvas pixel
    std::vector<int32_t> ends;   // of each node the two that it lies between; a vertex has itself twice
    std::vector<Face> faces;
    int count() const { return (int)(nodes.size() / 2); }
};

Refined decode_mesh(const Mesh &mesh, Budget &budget);

}  // namespace pxi
