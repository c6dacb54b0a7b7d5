// Which samples of a view show, and which are trusted (PYR-39 to PYR-41, PYR-46, PYR-52, PYR-53).
#pragma once

#include "texture.h"

namespace pxi {

typedef std::vector<uint8_t> Mask;  // [height][width] of a part, 0 or 1

// Samples at the layer's own boundary that are unmixed (PYR-52).
struct Edge {
    Mask core;                  // samples that are unmixed
    std::vector<double> share;  // of the layer's own colour in each of these, in their order, 0.5..1
    Mask outer;                 // samples beyond, which continue the colours of those
    Mask free;                  // samples whose colour is that of what is behind
};

struct Masks {
    Mask shown, trusted;  // empty: all
    bool unmixed = false;
    Edge edge;            // if `unmixed`
    Mask soft;            // samples with the alpha of the matte where they do not show; empty: none
};

class Occlusion {
    const File &file;
    const std::vector<Boundary> &boundaries;
    const Limits &limits;
    const Scene &scene;
    const int n, k;  // the layer, and the texture that it shows
    const Texr &texr;
    const int w, h;

    int body(int layer) const;  // that a layer moves with, or -1
    Mask masked() const;
    std::vector<int32_t> covered(int layer) const;  // [h][w]; empty: all
    Mask bare_behind() const;
    Masks hard(Mask *lost) const;
    Edge edge_of(const std::vector<int32_t> &own, const Mask &open, const Mask &lost) const;

  public:
    Occlusion(const File &file, const std::vector<Boundary> &boundaries, const Limits &limits, const Scene &scene, int n)
        : file(file), boundaries(boundaries), limits(limits), scene(scene), n(n), k(file.source(n)),
          texr(file.textures[k]), w(texr.part[2]), h(texr.part[3]) {}
    // Whether a layer rests on layer n (PYR-46, MOT-9).
    bool rests(int other) const;
    bool in_place() const;
    Masks masks() const;
};

// Samples of a raster that lie in stored cells of a plan (PYR-5).
Mask stored_of(const Plan &plan);

// Samples of a part of this size in cells of a mask.
Mask spread(const Mask &cells, int log2, int w, int h);

}  // namespace pxi
