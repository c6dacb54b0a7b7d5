// A file that is open: its values, its layers at rest, and what was decoded for drawing.
#pragma once

#include <optional>

#include "chart.h"
#include "motion.h"
#include "read.h"
#include "texture.h"

namespace pxi {

struct Image {
    Budget budget;                  // of reading
    std::unique_ptr<File> file;
    std::vector<Boundary> boundaries;
    std::vector<Refined> meshes;        // by layer, as what follows; without faces where there is none
    std::vector<Points> moved, places;  // displacements by poses in 1/16 pixel; none where there are none
    std::optional<Motion> motion;
    std::unique_ptr<Textures> textures;

    // Reads and checks a file.
    Image(Bytes bytes, const Limits &limits, FindModel models, const Watch &watch);

    const Refined *mesh(int layer) const {
        return meshes[layer].faces.empty() ? nullptr : &meshes[layer];
    }
};

}  // namespace pxi
