#include "image.h"

namespace pxi {

Image::Image(Bytes bytes, const Limits &limits, FindModel models, const Watch &watch) : budget(limits) {
    file = read_file(bytes, budget);
    watch.ask(1, 2);
    for (const Layr &layr : file->layers) boundaries.push_back(decode_boundary(layr));
    for (const auto &[layer, mesh] : file->meshes) {
        meshes[layer] = decode_mesh(mesh, budget);
        watch.ask(1, 2);
    }
    for (const auto &[layer, pose] : file->poses) {
        for (const bool node : {true, false}) {
            Points found = node ? displacements(pose, pose.node_classes, pose.node_deltas, mesh(layer))
                                : displacements(pose, pose.place_classes, pose.place_deltas, mesh(layer));
            if (!found.empty()) (node ? moved : places)[layer] = std::move(found);
        }
    }
    if (file->moves) motion.emplace(file->motion, meshes, budget);
    textures = std::make_unique<Textures>(*file, boundaries, limits, std::move(models));
    watch.ask(1, 1);
}

}  // namespace pxi
