// Chapter 6, "Texture points": which point of a layer at rest each sample shows.
#pragma once

#include "pose.h"

namespace pxi {

// The samples of a view: a grid of columns by rows over a region of the canvas (REN-2, REN-3).
struct View {
    std::array<int, 4> region;   // x, y, width, height in canvas pixels
    int width, height;           // output
    int sx, sy;                  // samples of a pixel across and down
    View(const std::array<int, 4> &region, int width, int height);
    int64_t columns() const { return (int64_t)width * sx; }
    int64_t rows() const { return (int64_t)height * sy; }
    double x(int64_t column) const { return (column + .5) * (region[2] / (double)columns()) + region[0]; }
    double y(int64_t row) const { return (row + .5) * (region[3] / (double)rows()) + region[1]; }
};

// Texture points of samples.
struct Located {
    std::vector<double> x, y;     // in canvas pixels at rest
    std::vector<int32_t> face;    // that each lies in, or the nearest; only of a chart that weighs
    std::vector<double> weights;  // [n][3] barycentric, in that face; likewise
};

class Chart {
    const Pose &pose;
    const Refined *mesh;  // null if it is not consulted
    bool weighs;
    double inverse[4], shift[2];          // of the affine map
    std::vector<double> corners, places;  // [faces][3][x, y] at present in canvas pixels, and what is shown there
    std::vector<double> centres;          // [faces][x, y], infinite where a face has no area
    std::vector<double> away;             // [faces][6]: offset to the point that is shown, affine in the point

    double area(const double *p) const { return (p[2] - p[0]) * (p[5] - p[1]) - (p[3] - p[1]) * (p[4] - p[0]); }
    void prepare();

  public:
    // `moves` are displacements of nodes in 1/1024 canvas pixel, `shown` those of the points that nodes show in
    // 1/16; none if there are none. `weighs`: whether faces and weights are wanted in any case.
    Chart(const Pose &pose, const Points &moves, const Points &shown, const Refined *mesh, bool weighs);

    bool meshed() const { return mesh; }
    bool straight() const { return !mesh && pose.identity(); }  // every sample shows its own point

    // The face of each sample of a rectangle, or -1 (MSH-33).
    std::vector<int32_t> faces(const View &view, const Box &box, Budget &budget) const;

    // Texture points of n canvas points; `face` is that of each, or -1, if the chart is meshed.
    Located locate(const double *x, const double *y, const int32_t *face, size_t n, Budget &budget) const;
};

}  // namespace pxi
