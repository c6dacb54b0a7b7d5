// One layer in one view: what it covers, and its colours (REN-4 to REN-6).
#pragma once

#include <memory>

#include "parallel.h"
#include "render.h"

namespace pxi {

// What painters of a picture share.
struct Canvas {
    Image &image;
    const Request &request;
    Scene scene;
    std::vector<Points> sway;   // by layer, as Motion::at gives it
    std::vector<uint8_t> seen;   // by layer: whether what hides samples of it hides what they would show, too
    Mutex decoding;              // of textures
};

class Painter {
    Canvas &canvas;
    const int number;
    const Layr &layr;
    const Texr &texr;
    const Pose &pose;
    Points moves;
    Boundary paths;   // in 1/256 sample; none: all samples
    Chart chart;
    Window window;    // samples of the part of a pyramid texture that are needed
    std::vector<double> anchors, node_features, anchor_features;  // x0, y0, ..; [..][dim]: of node sampling

    struct Source {   // samples of the part of a pyramid texture, premultiplied
        Samples samples;
        const float *at;  // that of row 0 and column 0 of the part
        Source(const Samples &s, const float *a) : samples(s), at(a) {}
    };
    std::unique_ptr<Source> raster, view;
    std::vector<float> padded;  // samples of the window with a border for interpolation

    struct Positions {  // of samples along one axis of a texture
        std::vector<int32_t> before;
        std::vector<float> part;
        bool whole = true;  // whether all parts are 0
        void add(double at, int last);
    };

    Window needed() const;
    int dim() const;  // features of a code
    const Source &as_raster();
    const Source &as_view();
    const std::vector<float> &bordered();
    void prepare_nodes();
    void features(double x, double y, double *out) const;
    void paint_view(const Box &box, const std::vector<int32_t> &at, const Located *shown, float *out);
    void copy_exact(const Box &box, const std::vector<int32_t> &at, const Positions &x, const Positions &y, float *out);
    void paint_codes(const Located &shown, float *out, Budget &budget);
    void paint_nodes(const Located &shown, float *out, Budget &budget);
    void recolour(float *colours, size_t n) const;

  public:
    Painter(Canvas &canvas, int layer, Budget &budget);

    // Coverage 0..1 of the samples of a rectangle in the rows from `start` on that it may cover; false if all are
    // covered, which leaves it empty.
    bool cover(const Box &box, std::vector<float> &coverage, int64_t *start, Budget &budget) const;

    // Premultiplied colours and alphas [n][4] of the samples `at` of a rectangle.
    void paint(const Box &box, const std::vector<int32_t> &at, float *out, Budget &budget);
};

}  // namespace pxi
