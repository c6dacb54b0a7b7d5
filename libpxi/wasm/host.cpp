// The decoder as a WebAssembly module: what JavaScript calls (web/pxi-wasm/module.js), and what it is asked for.
//
// An instance has one file. Nothing is caught in here, as WebAssembly has no exceptions that all browsers know: a
// failure calls `failed` of the host (errors.cpp), which throws in JavaScript. That skips all frames of the module, so the
// instance must not be called again: the host gives it up, with all of its memory, and makes another.
#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "../src/image.h"
#include "../src/output.h"
#include "../src/request.h"

#define IMPORTED(name) __attribute__((import_module("pxi"), import_name(name)))
#define EXPORTED(name) extern "C" __attribute__((export_name(name)))

extern "C" {
// Told the share that is done, 0..1; fails if the caller wants to stop.
IMPORTED("progress") void pxi_told(double share);
// Inflates a zstd frame into exactly `size` bytes, or fails.
IMPORTED("inflate") void pxi_inflate(const uint8_t *frame, size_t count, uint8_t *to, size_t size);
}

namespace pxi {

static Limits limits, limits_of_file;  // of the next call, and of the one that opened the file
static std::vector<std::pair<std::string, Bytes>> models;
static Image *image;  // is never destroyed: the instance is
static std::vector<uint32_t> drawn;
static bool opaque;  // the last picture

// The host checks that the frame is of zstd, and has nothing after it.
std::vector<uint8_t> decompressed(Bytes frame, int64_t size, const Place &at, Budget &budget) {
    budget.spend(METADATA_BYTES, size);
    need(frame.size() >= 4, "CHK-16", "metadata is not a zstd frame", at);
    std::vector<uint8_t> out((size_t)size);
    pxi_inflate(frame.data(), frame.size(), out.data(), out.size());
    return out;
}

static int told(void *, int done, int all) {
    pxi_told(done / (double)std::max(all, 1));
    return 0;
}

static int find(void *, const char *file, const void **bytes, size_t *count) {
    for (const auto &[name, weights] : models)
        if (name == file) *bytes = weights.data(), *count = weights.size();
    return 0;
}

// Room for what the host brings: it stays.
EXPORTED("room") void *room(size_t size) { return operator new(size); }

// A limit of the next call; what is told before the file is opened holds for all.
EXPORTED("limit") void limit(const char *name, double value) {
    const pxi_limit change = {name, (uint64_t)value};
    set_limits(limits, &change, 1);
}

EXPORTED("model") void model(const char *file, const uint8_t *weights, size_t count) {
    models.push_back({file, {weights, count}});
}

EXPORTED("open") void open(const uint8_t *from, size_t count) {
    image = new Image(Bytes(from, count), limits, {find, nullptr}, Watch{told, nullptr});
    limits_of_file = limits;
}

// Numbers of what was opened, as module.js names them.
EXPORTED("info") const int32_t *info() {
    const File &file = *image->file;
    static int32_t found[11];
    const int32_t all[11] = {file.head.width, file.head.height, file.head.opaque, file.head.depth,
                           (int32_t)file.layers.size(), (int32_t)file.plans.size(), (int32_t)file.blocks.size(),
                           file.moves ? file.motion.duration : 0, file.moves ? file.motion.fps : 0,
                           file.primaries, file.transfer};
    std::memcpy(found, all, sizeof all);
    return found;
}
EXPORTED("name") const char *name(int layer) { return image->file->layers[layer].name.data(); }
EXPORTED("name_size") size_t name_size(int layer) { return image->file->layers[layer].name.size(); }
EXPORTED("hidden") int hidden(int layer) { return image->file->pose(layer).hidden; }
EXPORTED("plan_model") int plan_model(int plan) { return image->file->plans[plan].model; }
EXPORTED("kind") const char *kind(int block) { return image->file->blocks[block].kind.c_str(); }
EXPORTED("block") const uint8_t *block(int number) { return image->file->blocks[number].bytes.data(); }
EXPORTED("block_size") size_t block_size(int number) { return image->file->blocks[number].bytes.size(); }

EXPORTED("draw") void draw(int layer) { drawn.push_back((uint32_t)layer); }

// Draws the layers that `draw` told, or all, and forgets them; the pixels are there until the host gives them up.
EXPORTED("render") void *render(uint32_t x, uint32_t y, uint32_t w, uint32_t h, uint32_t width, uint32_t height,
                                uint32_t format, int moving, double time, int draft) {
    pxi_request asked = PXI_REQUEST_INIT;
    asked.x = x, asked.y = y, asked.region_width = w, asked.region_height = h;
    asked.width = width, asked.height = height, asked.format = format;
    asked.moving = (uint32_t)moving, asked.time = time;
    if (!drawn.empty()) asked.layers = drawn.data(), asked.layer_count = drawn.size();
    Request own = requested(*image, asked, limits);
    own.draft = draft;
    drawn.clear(), limits = limits_of_file;
    const uint64_t stride = (uint64_t)own.view.width * pixel_bytes(format), size = stride * own.view.height;
    if (size > PTRDIFF_MAX) out_of_memory();
    void *pixels = operator new((size_t)size);
    opaque = own.opaque(*image);
    render(*image, own, {pixels, (size_t)stride, format, opaque}, [](double share) { pxi_told(share); });
    return pixels;
}

// Whether all alphas of the last picture are 1: decoders put it out without.
EXPORTED("opaque") int is_opaque() { return opaque; }
EXPORTED("give_up") void give_up(void *pixels) { operator delete(pixels); }

}  // namespace pxi
