#include "image.h"

namespace pxi {

Image::Image(Bytes bytes, const Limits &limits, FindModel models, const Watch &watch) : budget(limits) {
    file = read_file(bytes, budget);
    watch.ask(1, 2);
    for (const Layr &layr : file->layers) boundaries.push_back(decode_boundary(layr));
    for (auto *of_layers : {&moved, &places}) of_layers->resize(file->layers.size());
    meshes.resize(file->layers.size());
    for (const Mesh &mesh : file->meshes) {
        meshes[mesh.layer] = decode_mesh(mesh, budget);
        watch.ask(1, 2);
    }
    for (const Pose &pose : file->poses) {
        moved[pose.layer] = displacements(pose, pose.node_classes, pose.node_deltas, mesh(pose.layer));
        places[pose.layer] = displacements(pose, pose.place_classes, pose.place_deltas, mesh(pose.layer));
    }
    if (file->moves) motion.emplace(file->motion, meshes, budget);
    textures = std::make_unique<Textures>(*file, boundaries, limits, models);
    watch.ask(1, 1);
}

}  // namespace pxi
