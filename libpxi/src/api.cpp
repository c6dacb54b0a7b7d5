// The C interface: what comes from a caller is checked here, and nothing is thrown over the border.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <new>
#include <stdexcept>

#include "image.h"
#include "output.h"
#include "request.h"

using namespace pxi;

struct pxi_file {
    Image image;
};

namespace {

// A structure of a caller, whose `size` tells how much of it he knows. What he does not know is 0. If he knows
// more than this library, what it does not know must be 0.
template <class T> T known(const T *from) {
    T out{};
    if (!from) return out;
    usage(from->size >= sizeof(T), "the size of a structure is not that of this ABI");
    const char *bytes = (const char *)from;
    usage(std::all_of(bytes + sizeof(T), bytes + from->size, [](char c) { return !c; }),
          "a structure has fields that this version of the library does not know");
    std::memcpy((void *)&out, bytes, sizeof(T));
    return out;
}

// Fills a structure of a caller as far as he knows it.
template <class T> void fill(T *to, T value) {
    usage(to, "an argument is null");
    usage(to->size >= sizeof(T), "the size of a structure is not that of this ABI");
    value.size = to->size;
    std::memset((char *)to + sizeof(T), 0, to->size - sizeof(T));
    std::memcpy((void *)to, &value, sizeof(T));
}

// Makes no room for anything: memory may have ended.
pxi_status told(pxi_error *to, uint32_t status, const char *rule, const char *message, const Place &at) {
    if (!to) return (pxi_status)status;
    pxi_error error = PXI_ERROR_INIT;
    error.size = to->size, error.status = status, error.offset = at.offset;
    std::snprintf(error.rule, sizeof error.rule, "%s", rule);
    const char *chunk = *at.chunk ? "chunk " : "", *then = *at.chunk ? ": " : "";
    const int length = std::snprintf(error.message, sizeof error.message, "%s%s%s%s", chunk, at.chunk, then, message);
    if (length >= (int)sizeof error.message) {  // no part of a character is left at the end
        char *end = error.message + sizeof error.message - 2;
        while (end > error.message && (*end & 0xC0) == 0x80) *end-- = 0;
        if (*end & 0x80) *end = 0;
    }
    std::memcpy(to, &error, sizeof error);
    return (pxi_status)status;
}

// Does the work of a function of the interface.
template <class Work> pxi_status guarded(pxi_error *error, const Work &work) {
    if (error && error->size < sizeof(pxi_error)) return PXI_USAGE;
#ifdef __cpp_exceptions
    try {
        work();
    } catch (const Failure &failure) {
        return told(error, (uint32_t)failure.kind, failure.rule, failure.message.c_str(), failure.at);
    } catch (const std::bad_alloc &) {
        return told(error, PXI_MEMORY, "", "there is not enough memory", {});
    } catch (const std::length_error &) {  // of a vector that is larger than any memory
        return told(error, PXI_MEMORY, "", "there is not enough memory", {});
    }
#else
    work();
#endif
    return told(error, PXI_OK, "", "", {});
}

const Image &opened(const pxi_file *file) {
    usage(file, "the file is null");
    return file->image;
}

struct Hearing {  // of a caller, while a file is opened
    pxi_progress progress;
    void *context;
    static int ask(void *self, int done, int all) {
        const Hearing &own = *(Hearing *)self;
        return own.progress ? own.progress(own.context, done / (double)std::max(all, 1)) : 0;
    }
};

pxi_file *open(Bytes bytes, const pxi_options &options) {
    Limits limits;
    set_limits(limits, options.limits, options.limit_count);
    const FindModel find = {options.model, options.model_context};
    Hearing hearing = {options.progress, options.progress_context};
    return new pxi_file{Image(bytes, limits, find, Watch{Hearing::ask, &hearing})};
}

}  // namespace

extern "C" {

uint32_t pxi_abi(void) { return PXI_ABI; }

pxi_status pxi_open(const void *bytes, size_t count, const pxi_options *options, pxi_file **out, pxi_error *error) {
    if (out) *out = nullptr;
    return guarded(error, [&] {
        usage(out && (bytes || !count), "an argument is null");
        *out = open({(const uint8_t *)bytes, count}, known(options));
    });
}

pxi_status pxi_open_callback(int64_t (*read)(void *, void *, size_t), void *context, const pxi_options *options,
                             pxi_file **out, pxi_error *error) {
    if (out) *out = nullptr;
    return guarded(error, [&] {
        usage(out && read, "an argument is null");
        const pxi_options own = known(options);
        Limits limits;
        set_limits(limits, own.limits, own.limit_count);
        std::vector<uint8_t> bytes;
        for (size_t end = 0;;) {
            bytes.resize(std::max(2 * end, (size_t)1 << 16));
            const int64_t count = read(context, bytes.data() + end, bytes.size() - end);
            if (count < 0 || (uint64_t)count > bytes.size() - end) fail(Kind::IO, "", "the file cannot be read");
            if (!count) {
                *out = open({bytes.data(), end}, own);
                return;
            }
            Budget(limits).check(FILE_BYTES, (int64_t)(end += (size_t)count));
            if (own.progress && own.progress(own.progress_context, 0)) fail(Kind::STOPPED, "", "the caller asked to stop");
        }
    });
}

void pxi_close(pxi_file *file) { delete file; }

pxi_status pxi_describe(const pxi_file *file, pxi_info *info, pxi_error *error) {
    return guarded(error, [&] {
        const File &own = *opened(file).file;
        pxi_info found{};
        found.width = own.head.width, found.height = own.head.height;
        found.opaque = own.head.opaque, found.depth = own.head.depth;
        found.layers = (uint32_t)own.layers.size(), found.metadata = (uint32_t)own.blocks.size();
        if (own.moves) found.duration = own.motion.duration, found.fps = own.motion.fps, found.loop = own.motion.loop;
        found.primaries = own.primaries, found.transfer = own.transfer;
        fill(info, found);
    });
}

pxi_status pxi_describe_layer(const pxi_file *file, uint32_t number, pxi_layer *layer, pxi_error *error) {
    return guarded(error, [&] {
        const File &own = *opened(file).file;
        usage(number < own.layers.size(), "there is no layer of this number");
        const Layr &layr = own.layers[number];
        const std::vector<int> &moving = own.motion.layers;
        pxi_layer found{};
        found.hidden = own.pose((int)number).hidden;
        found.moves = own.moves && std::find(moving.begin(), moving.end(), (int)number) != moving.end();
        found.name = layr.name.c_str(), found.name_bytes = (uint32_t)layr.name.size();
        found.x = layr.box[0], found.y = layr.box[1], found.width = layr.box[2], found.height = layr.box[3];
        fill(layer, found);
    });
}

pxi_status pxi_describe_metadata(const pxi_file *file, uint32_t number, pxi_metadata *block, pxi_error *error) {
    return guarded(error, [&] {
        const std::vector<Block> &blocks = opened(file).file->blocks;
        usage(number < blocks.size(), "there is no block of this number");
        pxi_metadata found{};
        std::strncpy(found.kind, blocks[number].kind.c_str(), sizeof found.kind - 1);
        found.count = blocks[number].bytes.size(), found.bytes = blocks[number].bytes.data();
        fill(block, found);
    });
}

pxi_status pxi_measure(const pxi_file *file, const pxi_request *request, pxi_output *output, pxi_error *error) {
    return guarded(error, [&] {
        const Image &image = opened(file);
        const pxi_request asked = known(request);
        const Request own = requested(image, asked, image.budget.limits);
        pxi_output found{};
        found.width = own.view.width, found.height = own.view.height, found.opaque = own.opaque(image);
        found.row_bytes = own.view.width * pixel_bytes(asked.format);
        if ((uint64_t)found.row_bytes * own.view.height > PTRDIFF_MAX) fail(Kind::LIMIT, "", "no buffer can hold the picture");
        found.bytes = found.row_bytes * own.view.height;
        fill(output, found);
    });
}

pxi_status pxi_render(pxi_file *file, const pxi_request *request, void *pixels, size_t bytes, size_t stride,
                      pxi_error *error) {
    return guarded(error, [&] {
        Image &image = const_cast<Image &>(opened(file));
        usage(pixels, "the buffer is null");
        const pxi_request asked = known(request);
        const Request own = requested(image, asked, image.budget.limits);
        const size_t pixel = pixel_bytes(asked.format), row = own.view.width * pixel, rows = own.view.height;
        if (!stride) stride = row;
        usage(stride >= row, "the stride is smaller than a row");
        usage(bytes >= row && (bytes - row) / stride >= rows - 1, "the buffer is too small");
        usage((uintptr_t)pixels % (pixel / 4) == 0 && stride % (pixel / 4) == 0, "the buffer is not aligned");
        render(image, own, {pixels, stride, asked.format, own.opaque(image)}, [&](double share) {
            if (asked.progress && asked.progress(asked.progress_context, share))
                fail(Kind::STOPPED, "", "the caller asked to stop");
        });
    });
}

pxi_status pxi_latents(pxi_file *file, uint32_t plane, int32_t *values, size_t *count, pxi_error *error) {
    return guarded(error, [&] {
        const Image &image = opened(file);
        usage(plane < image.file->plans.size(), "there are no planes of this number");
        usage(count, "an argument is null");
        const size_t room = values ? *count : 0;
        *count = image.textures->latent_count((int)plane);
        usage(!values || room >= *count, "the buffer is too small");
        if (!values) return;
        const std::vector<int32_t> found = image.textures->latents((int)plane);
        std::copy(found.begin(), found.end(), values);
    });
}

}  // extern "C"
