#include "output.h"

#include <algorithm>

#include "core.h"

namespace pxi {

namespace {

// A row of samples [n][channels] as n pixels of straight colour and alpha (REN-12, REN-14).
template <class Number> void put_row(const float *from, int channels, int n, bool opaque, Number *to) {
    constexpr int bits = 8 * sizeof(Number);
    if (!opaque) return core().finished(from, channels, n, 4, bits, to);
    core().finished(from, channels, n, 3, bits, to);
    for (int i = n; i-- > 0;) {  // from the last on, as they move apart
        for (int c = 3; c-- > 0;) to[4 * i + c] = to[3 * i + c];
        to[4 * i + 3] = (Number)-1;
    }
}

template <> void put_row(const float *from, int channels, int n, bool opaque, float *to) {
    for (int i = 0; i < n; i++, from += channels, to += 4) {
        const float alpha = opaque ? 1 : std::max(from[3], 1e-6f);
        for (int c = 0; c < 3; c++) to[c] = std::clamp(from[c] / alpha, 0.f, 1.f);
        to[3] = opaque ? 1 : std::clamp(from[3], 0.f, 1.f);
    }
}

}  // namespace

size_t pixel_bytes(uint32_t format) {
    usage(format <= PXI_RGBAF, "there is no format of this number");
    return format == PXI_RGBA8 ? 4 : format == PXI_RGBA16 ? 8 : 16;
}

void Pixels::put(const Box &box, const float *samples, int channels) const {
    char *to = (char *)at + box.y * stride + box.x * pixel_bytes(format);
    for (int y = 0; y < box.height; y++, samples += (size_t)box.width * channels, to += stride) {
        if (format == PXI_RGBA8) put_row(samples, channels, box.width, opaque, (uint8_t *)to);
        if (format == PXI_RGBA16) put_row(samples, channels, box.width, opaque, (uint16_t *)to);
        if (format == PXI_RGBAF) put_row(samples, channels, box.width, opaque, (float *)to);
    }
}

}  // namespace pxi
