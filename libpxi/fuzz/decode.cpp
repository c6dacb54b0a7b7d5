// Fuzz target of libFuzzer: opens any bytes, and draws them small, whole or in part, as the last byte says. Its mutator
// changes payloads of chunks, and puts lengths and checksums right, most of the time.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "pxi.h"

extern "C" size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t most);

namespace {

constexpr size_t PREFIX = 12, FRAME = 12;  // bytes before the first chunk; of a chunk without its payload

uint32_t checksum(const uint8_t *bytes, size_t count) {
    uint32_t crc = ~0u;
    for (size_t i = 0; i < count; i++) {
        crc ^= bytes[i];
        for (int k = 0; k < 8; k++) crc = crc & 1 ? 0xEDB88320u ^ crc >> 1 : crc >> 1;
    }
    return ~crc;
}

// Places of the chunks that are whole.
std::vector<size_t> chunks_of(const uint8_t *data, size_t size) {
    std::vector<size_t> found;
    for (size_t at = PREFIX; at + FRAME <= size;) {
        uint32_t length;
        std::memcpy(&length, data + at + 4, 4);
        if (length > size - at - FRAME) break;
        found.push_back(at), at += FRAME + length;
    }
    return found;
}

}  // namespace

extern "C" size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t most, unsigned seed) {
    const std::vector<size_t> chunks = chunks_of(data, size);
    if (seed % 16 == 0 || chunks.empty()) return LLVMFuzzerMutate(data, size, most);
    const size_t at = chunks[seed / 16 % chunks.size()];
    uint32_t length;
    std::memcpy(&length, data + at + 4, 4);
    const size_t behind = size - at - FRAME - length, room = std::min<size_t>(most - size + length, length + 64);
    if (size > most || !room) return LLVMFuzzerMutate(data, size, most);
    std::vector<uint8_t> payload(data + at + 8, data + at + 8 + length), rest(data + size - behind, data + size);
    payload.resize(room);
    length = (uint32_t)std::min(LLVMFuzzerMutate(payload.data(), length, room), room);
    std::memcpy(data + at + 4, &length, 4);
    std::copy_n(payload.data(), length, data + at + 8);
    const uint32_t crc = checksum(data + at, 8 + length);
    std::memcpy(data + at + 8 + length, &crc, 4);
    std::copy(rest.begin(), rest.end(), data + at + FRAME + length);
    return at + FRAME + length + rest.size();
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    // Small limits: what is wrong shows in small pictures, too.
    static const pxi_limit LIMITS[] = {{"samples", 1 << 14}, {"side", 1 << 12},          {"codes", 1 << 14},
                                       {"filled", 1 << 15},  {"multiply_adds", 1 << 28}, {"work", 1 << 20},
                                       {"faces", 1 << 12},   {"beyond", 1 << 20},        {"metadata_bytes", 1 << 16},
                                       {"covered", 1 << 18}, {"parameters", 1 << 16},    {"motion", 1 << 14},
                                       {"gates", 1 << 12},   {"wavefronts", 1 << 12}};
    pxi_options options = PXI_OPTIONS_INIT;
    options.limits = LIMITS, options.limit_count = sizeof LIMITS / sizeof *LIMITS;
    pxi_file *file = nullptr;
    pxi_error error = PXI_ERROR_INIT;
    if (pxi_open(data, size, &options, &file, &error)) return 0;
    pxi_info info = PXI_INFO_INIT;
    pxi_describe(file, &info, &error);
    for (uint32_t i = 0; i < info.layers; i++) {
        pxi_layer layer = PXI_LAYER_INIT;
        pxi_describe_layer(file, i, &layer, &error);
    }
    const uint8_t how = size ? data[size - 1] : 0;
    pxi_request requests[3] = {PXI_REQUEST_INIT, PXI_REQUEST_INIT, PXI_REQUEST_INIT};
    requests[0].width = 1 + how % 31, requests[0].height = 1 + how % 29;
    requests[1].region_width = requests[1].region_height = 1, requests[1].width = 8, requests[1].format = PXI_RGBAF;
    requests[2].moving = info.duration != 0, requests[2].time = how / 64., requests[2].format = PXI_RGBA16;
    requests[2].width = 16;
    for (const pxi_request &request : requests) {
        pxi_output output = PXI_OUTPUT_INIT;
        if (pxi_measure(file, &request, &output, &error) || output.bytes > (1 << 22)) continue;
        std::vector<float> pixels((output.bytes + 3) / 4);
        pxi_render(file, &request, pixels.data(), 4 * pixels.size(), 0, &error);
    }
    pxi_close(file);
    return 0;
}
