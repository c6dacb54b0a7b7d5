#include "thumbnail.h"

#include <algorithm>
#include <cmath>

#include "parallel.h"

namespace pxi {

namespace {

// Root mean square, in 8-bit levels, that a thumbnail may lose, and that a level is taken to add where a file does
// not tell; fewest samples that are left for an output pixel, across and down; output rows drawn at a time.
constexpr double ERROR_MAX = 1.4, UNKNOWN = 12, SPAN_MIN = 1.4;
constexpr int STRIP = 64;

bool plain(const Image &image, int n) {
    const File &file = *image.file;
    const Texr &texr = file.textures[file.source(n)];
    return texr.coder == PYRAMID && !texr.alpha && texr.mask.empty() && !of_layer(file.poses, n);
}

// Numbers of the planes that all layers show, each sample on its pixel; -1 if there are none.
int raster_of(const Image &image, const Request &request) {
    const File &file = *image.file;
    if (!request.opaque(image) || request.moving) return -1;
    const Texr &first = file.textures[file.source(0)];
    for (const int n : request.drawn) {
        const Texr &texr = file.textures[file.source(n)];
        const std::array<int, 4> &box = file.layers[n].box, &part = texr.part;
        if (!plain(image, n) || texr.planes != first.planes || box != part) return -1;
    }
    const Plan &plan = file.plans[first.planes];
    const std::array<int, 4> whole = {0, 0, file.head.width, file.head.height};
    return file.layers[0].box == whole && plan.width == whole[2] && plan.height == whole[3] ? first.planes : -1;
}

// How many of the finest levels a thumbnail does without; a draft, without all that are finer than its pixels.
int spare(const Plan &plan, double span, bool draft) {
    double error = 0;
    int found = 0;
    for (int level = 1; level <= plan.levels; level++) {
        const double detail = plan.details.empty() ? UNKNOWN : plan.details[level - 1] / 8.;
        error += std::pow(detail * (1 << (level - 1)) / span, 2);
        // Interpolating what is left blurs it, the more levels there are, the more.
        const double lost = error * (0.7 + 0.15 * level);
        if (draft ? span < 1 << level : lost > ERROR_MAX * ERROR_MAX || span < SPAN_MIN * (1 << level)) break;
        found = level;
    }
    return found;
}

// What output pixels are mixed of along one axis: `count` times `taps` weights of samples from `first` on.
struct Taps {
    int taps = 0;
    std::vector<int> first;
    std::vector<float> weights;
    int size;  // samples, of which those at the ends are repeated

    Taps(int start, double span, int count, int level, int n) : first(count), size(n) {
        const int points = (int)std::ceil(span / (1 << level));
        std::vector<int> before((size_t)count * points);
        std::vector<float> parts((size_t)count * points);
        for (size_t i = 0; i < before.size(); i++) {
            double at = start + (i + .5) * (span / points);
            at = std::clamp((at - .5) / (1 << level), 0., n - 1.);
            before[i] = (int)at, parts[i] = (float)(at - before[i]);
        }
        for (int k = 0; k < count; k++) {
            first[k] = before[(size_t)k * points] - 1;
            taps = std::max(taps, before[(size_t)(k + 1) * points - 1] + 3 - first[k]);
        }
        weights.resize((size_t)count * taps);
        for (size_t i = 0; i < before.size(); i++) {
            const size_t k = i / points;
            const float f = parts[i];
            float *w = &weights[k * taps + before[i] - 1 - first[k]];
            w[0] += ((2 - f) * f - 1) * f * .5f / points, w[1] += ((3 * f - 5) * f * f + 2) * .5f / points;
            w[2] += ((4 - 3 * f) * f + 1) * f * .5f / points, w[3] += (f - 1) * f * f * .5f / points;
        }
    }
    int at(int k, int tap) const { return std::clamp(first[k] + tap, 0, size - 1); }
    int low() const { return std::max(first.front(), 0); }
    int high() const { return std::min(first.back() + taps, size); }
};

// Puts samples as they are, pixel by pixel.
void copy(Image &image, const Request &request, int number, const Pixels &pixels) {
    const std::array<int, 4> &region = request.view.region;
    const int x = region[0], y = region[1], w = region[2], h = region[3];
    const Samples samples = image.textures->raster(number, 0, {y, y + h, x, x + w});
    const int C = samples.channels;
    parallel(request.threads, (h + STRIP - 1) / STRIP, [&](int64_t k) {
        std::vector<float> grey(C == 1 ? 3 * (size_t)w : 0);
        for (int row = (int)k * STRIP; row < std::min((int)(k + 1) * STRIP, h); row++) {
            const float *from = samples.at + ((int64_t)(y + row) * samples.columns + x) * C;
            for (size_t i = 0; i < grey.size(); i++) grey[i] = from[i / 3];
            pixels.put({0, row, w, 1}, grey.empty() ? from : grey.data(), 3);
        }
    });
}

}  // namespace

bool thumbnail(Image &image, const Request &request, const Pixels &pixels, Told told) {
    const View &view = request.view;
    const bool same = view.width == view.region[2] && view.height == view.region[3];
    if (!same && (view.width >= view.region[2] || view.height >= view.region[3])) return false;
    const int number = raster_of(image, request);
    if (number < 0) return false;
    if (same) {
        copy(image, request, number, pixels);
        told(1);
        return true;
    }
    const double across = view.region[2] / (double)view.width, down = view.region[3] / (double)view.height;
    const int level = spare(image.file->plans[number], std::min(across, down), request.draft);
    int rows, columns;
    image.textures->shape(number, level, &rows, &columns);
    const Taps y(view.region[1], down, view.height, level, rows), x(view.region[0], across, view.width, level, columns);
    const Window window = {y.low(), y.high(), x.low(), x.high()};
    const Samples samples = image.textures->raster(number, level, window);
    const int C = samples.channels, wide = window.columns() * C;
    std::vector<float> line(wide), out((size_t)STRIP * view.width * 3);
    for (int top = 0; top < view.height; top += STRIP) {
        const int height = std::min(STRIP, view.height - top);
        for (int row = 0; row < height; row++) {
            std::fill(line.begin(), line.end(), 0.f);
            for (int tap = 0; tap < y.taps; tap++) {
                const float weight = y.weights[(size_t)(top + row) * y.taps + tap];
                if (weight == 0) continue;
                const float *from = samples.at + ((int64_t)y.at(top + row, tap) * samples.columns + window.left) * C;
                for (int i = 0; i < wide; i++) line[i] += weight * from[i];
            }
            float *to = &out[(size_t)row * view.width * 3];
            for (int column = 0; column < view.width; column++, to += 3) {
                to[0] = to[1] = to[2] = 0;
                for (int tap = 0; tap < x.taps; tap++) {
                    const float weight = x.weights[(size_t)column * x.taps + tap];
                    const float *from = &line[(size_t)(x.at(column, tap) - window.left) * C];
                    for (int c = 0; c < 3; c++) to[c] += weight * from[std::min(c, C - 1)];
                }
            }
        }
        pixels.put({0, top, view.width, height}, out.data(), 3);
        told(1);
    }
    return true;
}

}  // namespace pxi
