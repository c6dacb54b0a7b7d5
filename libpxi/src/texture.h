// Rasters of the pyramid coder, decoded as far as they are asked for, and the views of them that
// layers show (chapter 8). Used by one thread at a time; what was returned may be read by several.
#pragma once

#include <memory>
#include <vector>

#include "geometry.h"
#include "limits.h"
#include "model.h"
#include "models.h"
#include "watch.h"
#include "window.h"

namespace pxi {

struct Samples {
    const float *at;          // [rows][..][channels], row 0 and column 0 of the whole raster or part
    int rows, columns;        // `columns` is what a row has in memory: at least as many as the part
    int channels;
    std::shared_ptr<const void> keep;  // the samples are there while it lives
};

// Which layers are drawn, and whether it is the picture at a time (MOT-9, PYR-46).
struct Scene {
    std::vector<uint8_t> drawn;  // by layer
    bool moving = false;
    bool operator==(const Scene &) const = default;
};

class Textures {
    struct Inner;
    std::unique_ptr<Inner> inner;

  public:
    // `file` and `boundaries` (of all layers) must outlive it.
    Textures(const File &file, const std::vector<Boundary> &boundaries, const Limits &limits, FindModel models = {});
    ~Textures();

    Watch watch;  // of what is decoded from now on

    // Rows and columns of a raster without its `level` finest levels (0: all of it).
    void shape(int plan, int level, int *rows, int *columns) const;

    // Samples 0..1 of a raster without its `level` finest levels; those in the window are right.
    Samples raster(int plan, int level, Window window);

    // Whether nothing that cuts what layer n shows has moved or looks different.
    bool in_place(int n, const Scene &scene) const;

    // What layer n shows of its raster: samples of the part, premultiplied, 1, 3 or 4 channels; those in
    // the window are right. The layer must have a texture of the pyramid coder, or show one.
    Samples view(int n, const Scene &scene, Window window);

    // All latents of a PLAN in the order of PYR-29: lowest planes, then levels from the coarsest on.
    std::vector<int32_t> latents(int plan);
    size_t latent_count(int plan) const;

    // Forgets what was decoded.
    void forget();
};

}  // namespace pxi
