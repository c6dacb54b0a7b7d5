// Fuzz target of libFuzzer: opens any bytes, and draws them small, whole or in part, as the last bytes say.
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "pxi.h"

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
