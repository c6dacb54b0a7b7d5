// Rasters of the pyramid coder, decoded as far as they are asked for, and the views of them that
// layers show (chapter 8). Used by one thread at a time; what was returned may be read by several.
#pragma once

#include <memory>
#include <vector>

#include "geometry.h"
#include "limits.h"
#include "model.h"

namespace pxi {

struct Window {  // rows top .. bottom - 1 and columns left .. right - 1
    int top, bottom, left, right;
    static Window whole(int rows, int columns) { return {0, rows, 0, columns}; }
    int rows() const { return bottom - top; }
    int columns() const { return right - left; }
    bool operator==(const Window &) const = default;
};

struct Samples {              // that belong to Textures, as long as it lives and is not asked again
    const float *at;          // [rows][columns][channels], row 0 and column 0 of the whole raster or part
    int rows, columns, channels;
};

// Which layers are drawn, and whether it is the picture at a time (MOT-9, PYR-46).
struct Scene {
    std::vector<uint8_t> drawn;  // by layer
    bool moving = false;
    bool operator==(const Scene &) const = default;
};

// Asks now and then whether to stop; both may be null. `done` of `all` is the work of one step.
struct Watch {
    int (*function)(void *user, int done, int all) = nullptr;
    void *user = nullptr;
    void ask(int done = 0, int all = 1) const {
        if (function && function(user, done, all)) fail(Kind::STOPPED, "", "the caller asked to stop");
    }
};

class Textures {
    struct Inner;
    std::unique_ptr<Inner> inner;

  public:
    // `file` and `boundaries` (of all layers) must outlive it.
    Textures(const File &file, const std::vector<Boundary> &boundaries, const Limits &limits);
    ~Textures();

    Watch watch;  // of what is decoded from now on

    // Rows and columns of a raster without its `level` finest levels (0: all of it).
    void shape(int plan, int level, int *rows, int *columns) const;

    // Samples 0..1 of a raster without its `level` finest levels; those in the window are right.
    Samples raster(int plan, int level, Window window);

    // What layer n shows of its raster: samples of the part, premultiplied, 3 or 4 channels; those in
    // the window are right. The layer must have a texture of the pyramid coder, or show one.
    Samples view(int n, const Scene &scene, Window window);

    // All latents of a PLAN in the order of PYR-29: lowest planes, then levels from the coarsest on.
    std::vector<int32_t> latents(int plan);

    // Forgets what was decoded.
    void forget();
};

}  // namespace pxi
