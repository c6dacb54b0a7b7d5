// A file as plain data: the values of its chunks, checked against every rule that needs nothing
// decoded (chapters 2 and 3), and its networks and planes of codes, which are decoded.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "errors.h"

namespace pxi {

typedef std::span<const uint8_t> Bytes;  // in the bytes that File keeps
typedef std::vector<int64_t> Ints;

struct Head {
    int width, height, channels, depth, layers, networks;
    bool opaque;
};

struct Layr {
    Place at;
    std::string name;
    std::array<int, 4> box;
    int sampling, unit;
    std::vector<int> segments;  // of each path; none: the whole canvas
    Bytes classes, deltas;
};

struct Mesh {  // not decoded
    Place at;
    int layer;
    std::array<int, 2> origin, step;
    int vertices, gates, levels;
    Bytes symbols, classes, deltas, splits;
    std::vector<int> far;
};

struct Pose {  // displacements are not decoded
    Place at;
    int layer = 0;
    std::array<int64_t, 4> matrix = {1 << 24, 0, 0, 1 << 24};
    std::array<int64_t, 2> shift = {0, 0};
    int opacity = 65535;
    bool hidden = false;
    std::vector<int> colour;  // 12 or none
    Bytes node_classes, node_deltas, place_classes, place_deltas;
    bool identity() const {
        return matrix == std::array<int64_t, 4>{1 << 24, 0, 0, 1 << 24} && shift == std::array<int64_t, 2>{};
    }
};

struct Netw {
    Place at;
    int dim, octaves, hidden, depth, channels, bits;
    Bytes steps, biases, weights;
    std::vector<float> values;  // as native/network.h takes them: weights [out][in], then biases, per layer
};

struct Plan {
    Place at;
    int model, width, height, components, step, levels, grey, cell, tile;
    std::vector<int> lowest, shifts, details;
    Bytes support, escapes, data;
};

enum Coder { SHARED, IMPLICIT, PYRAMID };

struct Texr {
    Place at;
    Coder coder;
    int texture = 0;  // SHARED: the number of the TEXR that it shows
    // IMPLICIT
    int network = 0, columns = 0, rows = 0, bits = 0;
    Bytes steps, stored, codes;
    std::vector<float> features;  // [rows][columns][dim], or dim / 2 for sampling 1
    // PYRAMID: alpha, behind, behind_alpha and matte are 0 or the number of planes plus 1
    int planes = 0, alpha = 0, cell = 0, behind = 0, behind_alpha = 0, grain = 0, unmix = 0, matte = 0;
    std::array<int, 4> part = {};
    Bytes mask, sources;
    std::vector<uint8_t> cells;   // of the mask, 0 or 1; none: all
    std::vector<uint8_t> copied;  // the offset of each cell of sources, counted from 1; none: none at all
    std::vector<int> cuts, offsets;
};

struct Motn {  // curves and shapes are not decoded, nor the script
    Place at;
    int duration, fps, loop, intervals, unit, modes, size;
    std::vector<int> layers, bodies;
    Bytes curve_classes, curve_deltas, shape_classes, shape_deltas, script;
};

struct Block {        // of metadata, decompressed
    std::string kind;  // "icc", "exif", "xmp"
    std::vector<uint8_t> bytes;
};

// Which of some items, by ascending layers, is that of a layer; null if none is.
template <class Item> const Item *of_layer(const std::vector<Item> &items, int layer) {
    size_t low = 0, high = items.size();
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (items[middle].layer < layer) low = middle + 1;
        else high = middle;
    }
    return low < items.size() && items[low].layer == layer ? &items[low] : nullptr;
}

struct File {
    std::vector<uint8_t> bytes;  // that the rest points into, so a File is never copied
    int minor;                   // version
    Head head;
    std::vector<Layr> layers;
    std::vector<Mesh> meshes;  // by ascending layers, of some of them
    std::vector<Pose> poses;   // likewise
    std::vector<Netw> networks;
    std::vector<Texr> textures;
    std::vector<Plan> plans;
    bool moves = false;          // whether there is a `motion`
    Motn motion = {};
    std::vector<Block> blocks;
    int primaries = 0, transfer = 0;  // of cICp; 0 without it
    Pose rest;

    File() = default;
    File(File &&) = default;
    File &operator=(File &&) = default;
    const Pose &pose(int layer) const {
        const Pose *found = of_layer(poses, layer);
        return found ? *found : rest;
    }
    // The number of the texture that a layer shows.
    int source(int layer) const { return textures[layer].coder == SHARED ? textures[layer].texture : layer; }
};

}  // namespace pxi
