// Chapter 6, "Pose" and "Outline": where layers are now. Points are x0, y0, x1, y1, ..
#pragma once

#include "geometry.h"
#include "mesh.h"

namespace pxi {

typedef std::vector<int64_t> Points;

// Adds to the residuals of nodes what is expected of each (MSH-18).
void predict(int32_t *values, const Refined &mesh);

// Displacements of all nodes in 1/16 canvas pixel; none where `classes` is empty (MSH-17 to MSH-19).
Points displacements(const Pose &pose, Bytes classes, Bytes deltas, const Refined *mesh);

// Points in 1/1024 canvas pixel under the affine map of a pose (MSH-20).
Points mapped(const Pose &pose, Points points);

struct Outline {
    Boundary paths;  // none: the whole canvas
    int unit;
};

// The outline of a layer with the boundary `at_rest`, in its present place (MSH-22 to MSH-29). `moves` are
// displacements of the nodes in 1/1024 canvas pixel; none if it is not bent.
Outline outline(const Outline &at_rest, const Head &head, const Pose &pose, const Points &moves, const Refined *mesh,
                const Budget &budget);

// The index of the first of the nearest of some centres x0, y0, ..; -1 if there are none.
template <class N> int nearest(const std::vector<N> &centres, N x, N y) {
    int best = -1;
    N least = 0;
    for (size_t i = 0; i < centres.size(); i += 2) {
        const N dx = centres[i] - x, dy = centres[i + 1] - y, square = dx * dx + dy * dy;
        if (best < 0 || square < least) best = (int)(i / 2), least = square;
    }
    return best;
}

}  // namespace pxi
