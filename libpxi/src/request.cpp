#include "request.h"

#include <algorithm>
#include <cmath>

namespace pxi {

namespace {

constexpr int64_t SIDE_MAX = 2097152;  // output columns or rows
constexpr uint32_t THREADS_MAX = 64;

// The integer nearest to a b / c, ties to even, but at least 1.
int64_t ratio(int64_t a, int64_t b, int64_t c) {
    const int64_t whole = a * b / c, rest = 2 * (a * b - whole * c);
    return std::max<int64_t>(whole + (rest > c || (rest == c && whole % 2)), 1);
}

std::array<int, 4> region_of(const Head &head, const pxi_request &asked) {
    if (!asked.region_width && !asked.region_height) {
        usage(!asked.x && !asked.y, "a region has no size");
        return {0, 0, head.width, head.height};
    }
    const uint64_t x = asked.x, y = asked.y, w = asked.region_width, h = asked.region_height;
    usage(w && h && x + w <= (uint64_t)head.width && y + h <= (uint64_t)head.height,
          "the region is empty or leaves the canvas");
    return {(int)x, (int)y, (int)w, (int)h};
}

View view_of(const Head &head, const pxi_request &asked) {
    const std::array<int, 4> region = region_of(head, asked);
    int64_t size[2] = {asked.width, asked.height};
    const int64_t w = region[2], h = region[3];
    if (asked.scale != 0) {
        usage(!asked.width && !asked.height, "give either a scale or a width and height");
        usage(std::isfinite(asked.scale) && asked.scale > 0, "the scale is not a positive number");
        if (asked.scale * std::max(w, h) > SIDE_MAX) size[0] = SIDE_MAX + 1;
        else
            for (int k = 0; k < 2; k++) size[k] = std::max<int64_t>((int64_t)std::nearbyint(region[k + 2] * asked.scale), 1);
    } else if (!asked.width && !asked.height) {
        size[0] = w, size[1] = h;
    } else if (!asked.height) {
        size[1] = ratio(h, asked.width, w);
    } else if (!asked.width) {
        size[0] = ratio(w, asked.height, h);
    }
    if (std::max(size[0], size[1]) > SIDE_MAX)
        fail(Kind::LIMIT, "", "the output would have more than 2097152 pixels a side");
    return View(region, (int)size[0], (int)size[1]);
}

// Numbers of the layers to draw, back to front.
std::vector<int> drawn_of(const File &file, const pxi_request &asked) {
    const size_t count = file.layers.size();
    std::vector<uint8_t> wanted(count);
    for (size_t i = 0; i < count; i++) wanted[i] = !file.pose((int)i).hidden;
    usage(asked.layers || !asked.layer_count, "layers is null, but layer_count is not 0");
    if (asked.layers) {
        std::fill(wanted.begin(), wanted.end(), 0);
        for (size_t i = 0; i < asked.layer_count; i++) {
            usage(asked.layers[i] < count, "there is no layer of this number");
            wanted[asked.layers[i]] = 1;
        }
    }
    if (asked.without_background && file.head.opaque) wanted[0] = 0;
    std::vector<int> drawn;
    for (size_t i = 0; i < count; i++)
        if (wanted[i]) drawn.push_back((int)i);
    usage(!drawn.empty() || (!asked.layers && !asked.without_background), "no layer is left to draw");
    return drawn;
}

}  // namespace

void set_limits(Limits &limits, const pxi_limit *changes, uint32_t count) {
    usage(changes || !count, "limits is null, but limit_count is not 0");
    for (uint32_t i = 0; i < count; i++) {
        const int limit = changes[i].name ? Limits::find(changes[i].name) : -1;
        usage(limit >= 0, "there is no limit of this name");
        limits.at[limit] = (int64_t)std::min<uint64_t>(changes[i].value, (uint64_t)1 << 62);
    }
}

Request requested(const Image &image, const pxi_request &asked, const Limits &limits) {
    Request out{view_of(image.file->head, asked), drawn_of(*image.file, asked), asked.moving != 0, 0, 1, false, limits};
    set_limits(out.limits, asked.limits, asked.limit_count);
    out.threads = (int)std::clamp<uint32_t>(asked.threads, 1, THREADS_MAX);
    if (!out.moving) return out;
    usage(image.motion.has_value(), "the picture does not move");
    usage(std::isfinite(asked.time) && std::abs(asked.time) < 9e12, "the time is not a number of seconds");
    out.time = (int64_t)std::nearbyint(asked.time * 1e6);
    return out;
}

}  // namespace pxi
