// Chapter 5: boundaries and their coverage; and outlines of layers that have moved (chapter 6).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "limits.h"
#include "model.h"

namespace pxi {

typedef std::vector<int64_t> Path;      // control points x0, y0, x1, y1, .., three a segment
typedef std::vector<Path> Boundary;     // none: the whole canvas

constexpr int64_t FULL = 131072;     // the coverage of a sample that is covered as a whole

// The paths of a layer at rest in 2**-unit canvas pixels.
Boundary decode_boundary(const Layr &layr);

// Paths in 1/256 sample; `region` x, y, width, height of the canvas has columns by rows samples (GEO-7).
Boundary scaled(const Boundary &boundary, int unit, const std::array<int, 4> &region, int64_t columns, int64_t rows);

// A rectangle of samples.
struct Box {
    int x, y, width, height;
    int64_t size() const { return (int64_t)width * height; }
};

// Coverage 0..FULL of the samples of a rectangle, [height][width], by paths in 1/256 sample.
std::vector<int32_t> coverage(const Boundary &scaled, const Box &box, Budget &budget);

// The same of the columns from 0 on, and rows from `top` to before `bottom`.
inline std::vector<int32_t> coverage(const Boundary &scaled, int columns, int top, int bottom, Budget &budget) {
    return coverage(scaled, {0, top, columns, bottom - top}, budget);
}

// Integer a / b rounded down, b > 0.
template <class N> N floored(N a, N b) { return a / b - (a % b < 0); }

}  // namespace pxi
