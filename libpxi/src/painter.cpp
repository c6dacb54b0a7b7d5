#include "painter.h"

#include <algorithm>
#include <cmath>

#include "core.h"

namespace pxi {

namespace {

constexpr int TAPS = 4, CHUNK = 4096;  // samples that a point is interpolated from, across; points at a time
constexpr double NEAR = 1e-4;          // least squared distance to an anchor
enum Sampling { DIRECT, BOTH, LOCAL, GLOBAL };

// Displacements in 1/1024 pixel: those of a pose, in 1/16, and of a motion (MOT-8); either may be none.
Points added(const Points &posed, const Points &swayed) {
    Points out(std::max(posed.size(), swayed.size()));
    for (size_t i = 0; i < posed.size(); i++) out[i] = 64 * posed[i];
    for (size_t i = 0; i < swayed.size(); i++) out[i] += swayed[i];
    return out;
}

// Anchors x0, y0, .. of a layer in canvas pixels (TEX-22).
std::vector<double> anchors_of(const Boundary &boundary, int unit, const Head &head) {
    const double w = head.width, h = head.height;
    if (boundary.empty()) return {w / 2, 0, w, h / 2, w / 2, h, 0, h / 2};
    std::vector<double> out;
    for (const Path &path : boundary)
        for (size_t k = 0; k < path.size(); k += 6)
            for (size_t axis = k; axis < k + 2; axis++) {
                const int64_t p = path[axis], q = path[axis + 2], r = path[axis + 4], s = path[(axis + 6) % path.size()];
                out.push_back((p + 3 * q + 3 * r + s) / (double)(8 << unit));
            }
    return out;
}

// The index before a point between `count` values, of which the last may be at `last`, and the fraction.
int32_t placed(double at, int count, int last, float *part) {
    at = std::clamp(at, 0., count - 1.);
    const int32_t before = std::min((int32_t)at, last);
    *part = (float)(at - before);
    return before;
}

}  // namespace

void Painter::Positions::add(double at, int count) {
    float f;
    before.push_back(placed(at, count, count - 1, &f));
    part.push_back(f);
    whole &= f == 0;
}

Painter::Painter(Canvas &c, int n, Budget &budget)
    : canvas(c), number(n), layr(c.image.file->layers[n]), texr(c.image.file->textures[c.image.file->source(n)]),
      pose(c.image.file->pose(n)), moves(added(c.image.moved[n], c.sway[n])),
      chart(pose, moves, c.image.places[n], c.image.mesh(n),
            layr.sampling == BOTH || layr.sampling == LOCAL) {
    const View &view = c.request.view;
    const Outline now = outline({c.image.boundaries[n], layr.unit}, c.image.file->head, pose, moves, c.image.mesh(n), budget);
    paths = scaled(now.paths, now.unit, view.region, view.columns(), view.rows());
    if (texr.coder == PYRAMID)
        window = needed();
    else if (layr.sampling)
        prepare_nodes();
}

int Painter::dim() const {
    const int all = canvas.image.file->networks[texr.network].dim;
    return layr.sampling == BOTH ? all / 2 : all;
}

// Samples of the part of a pyramid texture that the view needs.
Window Painter::needed() const {
    if (!chart.straight()) return Window::whole(texr.part[3], texr.part[2]);
    int spans[4];
    for (int k = 0; k < 2; k++) {
        const int count = texr.part[k + 2];
        const double scale = count / (double)layr.box[k + 2];
        const double first = (canvas.request.view.region[k] - (double)layr.box[k]) * scale;
        const double last = first + canvas.request.view.region[k + 2] * scale;
        spans[2 * k] = (int)std::clamp(std::floor(first) - TAPS, 0., count - 1.);
        spans[2 * k + 1] = (int)std::clamp(std::ceil(last) + TAPS, 1., (double)count);
    }
    return {spans[2], spans[3], spans[0], spans[1]};
}

bool Painter::cover(const Box &box, std::vector<float> &out, int64_t *start, Budget &budget) const {
    out.clear(), *start = 0;
    if (paths.empty()) return false;
    const std::vector<int32_t> covered = coverage(paths, box, budget);
    const auto some = [](int32_t v) { return v > 0; };
    const auto first = std::find_if(covered.begin(), covered.end(), some);
    if (first == covered.end()) return true;
    const auto last = std::find_if(covered.rbegin(), covered.rend(), some).base() - 1;
    *start = (first - covered.begin()) / box.width * box.width;
    const int64_t end = ((last - covered.begin()) / box.width + 1) * box.width;
    out.resize(end - *start);
    for (int64_t i = *start; i < end; i++) out[i - *start] = covered[i] * (1.f / FULL);
    return true;
}

// Samples of the raster itself, whether they show or not.
const Painter::Source &Painter::as_raster() {
    const Lock lock(canvas.decoding);
    if (!raster) {
        const auto [x, y, w, h] = texr.part;
        const Window part = {window.top + y, window.bottom + y, window.left + x, window.right + x};
        const Samples samples = canvas.image.textures->raster(texr.planes, 0, part);
        raster = std::make_unique<Source>(samples, samples.at + ((int64_t)y * samples.columns + x) * samples.channels);
    }
    return *raster;
}

const Painter::Source &Painter::as_view() {
    const Lock lock(canvas.decoding);
    if (!view) {
        const Samples samples = canvas.image.textures->view(number, canvas.scene, window);
        view = std::make_unique<Source>(samples, samples.at);
    }
    return *view;
}

const std::vector<float> &Painter::bordered() {
    const Source &from = as_view();
    const Lock lock(canvas.decoding);
    if (!padded.empty()) return padded;
    const int channels = from.samples.channels, C = std::max(channels, 3);
    std::vector<float> made((size_t)(window.rows() + TAPS - 1) * (window.columns() + TAPS - 1) * C);
    float *to = made.data();
    for (int i = window.top - 1; i < window.bottom + 2; i++) {
        const float *row = from.at + (int64_t)std::clamp(i, 0, texr.part[3] - 1) * from.samples.columns * channels;
        for (int j = window.left - 1; j < window.right + 2; j++)
            for (int c = 0; c < C; c++) *to++ = row[(int64_t)std::clamp(j, 0, texr.part[2] - 1) * channels + std::min(c, channels - 1)];
    }
    padded = std::move(made);
    return padded;
}

void Painter::paint(const Box &box, const std::vector<int32_t> &at, float *out, Budget &budget) {
    const View &view = canvas.request.view;
    if (chart.straight() && texr.coder == PYRAMID) {
        paint_view(box, at, nullptr, out);
    } else {
        std::vector<double> x(at.size()), y(at.size());
        std::vector<int32_t> faces;
        for (size_t i = 0; i < at.size(); i++) x[i] = view.x(box.x + at[i] % box.width), y[i] = view.y(box.y + at[i] / box.width);
        if (chart.meshed()) {
            const std::vector<int32_t> all = chart.faces(view, box, budget);
            for (const int32_t i : at) faces.push_back(all[i]);
        }
        Located shown;
        if (chart.straight())
            shown.x = std::move(x), shown.y = std::move(y);
        else
            shown = chart.locate(x.data(), y.data(), faces.data(), at.size(), budget);
        if (texr.coder == PYRAMID)
            paint_view(box, at, &shown, out);
        else if (layr.sampling)
            paint_nodes(shown, out, budget);
        else
            paint_codes(shown, out, budget);
    }
    recolour(out, at.size());
}

// `shown` are the texture points; null if the samples are these themselves, so that all of a column share x.
void Painter::paint_view(const Box &box, const std::vector<int32_t> &at, const Located *shown, float *out) {
    const View &view = canvas.request.view;
    const double scale[2] = {texr.part[2] / (double)layr.box[2], texr.part[3] / (double)layr.box[3]};
    const auto along = [&](double at, int k) { return (at - layr.box[k]) * scale[k] - .5; };
    Positions x, y;
    const int n = (int)at.size();
    for (int i = 0; i < (shown ? n : box.width); i++)
        x.add(along(shown ? shown->x[i] : view.x(box.x + i), 0), texr.part[2]);
    for (int i = 0; i < (shown ? n : box.height); i++)
        y.add(along(shown ? shown->y[i] : view.y(box.y + i), 1), texr.part[3]);
    if (!shown && x.whole && y.whole) return copy_exact(box, at, x, y, out);
    const std::vector<float> &samples = bordered();
    const int channels = std::max(as_view().samples.channels, 3), stride = window.columns() + TAPS - 1;
    std::vector<int32_t> first(CHUNK);
    std::vector<float> fx(CHUNK), fy(CHUNK), found((size_t)CHUNK * channels);
    for (int i = 0; i < n; i += CHUNK) {
        const int count = std::min(CHUNK, n - i);
        for (int k = 0; k < count; k++) {
            const int column = shown ? i + k : at[i + k] % box.width, row = shown ? i + k : at[i + k] / box.width;
            first[k] = (y.before[row] - window.top) * stride + x.before[column] - window.left;
            fx[k] = x.part[column], fy[k] = y.part[row];
        }
        const loops::Points points = {first.data(), fx.data(), fy.data(), count};
        core().sample(samples.data(), stride, channels, &points, found.data());
        core().premultiplied(found.data(), channels, count, out + (size_t)4 * i);
    }
}

void Painter::copy_exact(const Box &box, const std::vector<int32_t> &at, const Positions &x, const Positions &y, float *out) {
    const Source &from = canvas.seen[number] ? as_raster() : as_view();
    const int channels = from.samples.channels;
    std::vector<float> grey;
    for (size_t i = 0, end; i < at.size(); i = end) {  // in runs of samples that follow each other in a row
        const int row = at[i] / box.width, column = at[i] % box.width;
        for (end = i + 1; end < at.size() && at[end] == at[end - 1] + 1 && at[end] % box.width; end++)
            if (x.before[column + (end - i)] != x.before[column] + (int)(end - i)) break;
        const float *samples = from.at + ((int64_t)y.before[row] * from.samples.columns + x.before[column]) * channels;
        if (channels == 1) {
            grey.clear();
            for (size_t k = i; k < end; k++) grey.insert(grey.end(), 3, samples[k - i]);
            samples = grey.data();
        }
        core().premultiplied(samples, std::max(channels, 3), (int64_t)(end - i), out + 4 * i);
    }
}

void Painter::paint_codes(const Located &shown, float *out, Budget &budget) {
    const Netw &netw = canvas.image.file->networks[texr.network];
    const Net net = {netw.dim, netw.octaves, netw.hidden, netw.depth, netw.channels};
    const int n = (int)shown.x.size();
    budget.spend(MULTIPLY_ADDS, (int64_t)n * (int64_t)netw.values.size());
    std::vector<int32_t> base(n), stride(n, texr.columns);
    std::vector<float> fx(n), fy(n), found((size_t)n * netw.channels);
    for (int i = 0; i < n; i++) {
        const double x = (shown.x[i] - layr.box[0]) * ((texr.columns - 1) / (double)layr.box[2]);
        const double y = (shown.y[i] - layr.box[1]) * ((texr.rows - 1) / (double)layr.box[3]);
        const int32_t column = placed(x, texr.columns, texr.columns - 2, &fx[i]);
        base[i] = placed(y, texr.rows, texr.rows - 2, &fy[i]) * texr.columns + column;
    }
    const Entries entries = {base.data(), stride.data(), fx.data(), fy.data()};
    core().forward(&net, texr.features.data(), netw.values.data(), &entries, n, found.data());
    core().premultiplied(found.data(), netw.channels, n, out);
}

// Features of the plane of codes at a canvas point (TEX-11, TEX-12).
void Painter::features(double px, double py, double *out) const {
    const int D = dim();
    float fx, fy;
    const int column = placed((px - layr.box[0]) * ((texr.columns - 1) / (double)layr.box[2]), texr.columns, texr.columns - 2, &fx);
    const int row = placed((py - layr.box[1]) * ((texr.rows - 1) / (double)layr.box[3]), texr.rows, texr.rows - 2, &fy);
    const float *a = texr.features.data() + ((int64_t)row * texr.columns + column) * D, *b = a + (int64_t)texr.columns * D;
    for (int f = 0; f < D; f++) {
        const float top = a[f] + (a[D + f] - a[f]) * fx, bottom = b[f] + (b[D + f] - b[f]) * fx;
        out[f] = top + (bottom - top) * fy;
    }
}

void Painter::prepare_nodes() {
    const Refined *mesh = canvas.image.mesh(number);
    const int D = dim();
    if (layr.sampling != GLOBAL) {
        node_features.resize((size_t)mesh->count() * D);
        for (int i = 0; i < mesh->count(); i++)
            features(mesh->nodes[2 * i] / 1024., mesh->nodes[2 * i + 1] / 1024., &node_features[(size_t)i * D]);
    }
    if (layr.sampling == LOCAL) return;
    anchors = anchors_of(canvas.image.boundaries[number], layr.unit, canvas.image.file->head);
    anchor_features.resize(anchors.size() / 2 * D);
    for (size_t i = 0; i < anchors.size(); i += 2) features(anchors[i], anchors[i + 1], &anchor_features[i / 2 * D]);
}

// TEX-20 to TEX-23.
void Painter::paint_nodes(const Located &shown, float *out, Budget &budget) {
    const Netw &netw = canvas.image.file->networks[texr.network];
    const Net net = {netw.dim, netw.octaves, netw.hidden, netw.depth, netw.channels};
    const Refined *mesh = canvas.image.mesh(number);
    const int D = dim(), n = (int)shown.x.size();
    budget.spend(MULTIPLY_ADDS, n * ((int64_t)netw.values.size() + (int64_t)anchors.size() / 2 * D * ANCHOR_COST));
    // The network runs on features as if each were a code of its own, with one more behind the last.
    std::vector<float> input((size_t)(CHUNK + 1) * netw.dim), zero(CHUNK), found((size_t)CHUNK * netw.channels);
    std::vector<int32_t> base(CHUNK), stride(CHUNK);
    std::vector<double> sums(netw.dim);
    for (int i = 0; i < CHUNK; i++) base[i] = i;
    const Entries entries = {base.data(), stride.data(), zero.data(), zero.data()};
    for (int i = 0; i < n; i += CHUNK) {
        const int count = std::min(CHUNK, n - i);
        for (int k = i; k < i + count; k++) {
            std::fill(sums.begin(), sums.end(), 0);
            double *to = sums.data();
            if (layr.sampling != GLOBAL) {
                for (int j = 0; j < 3; j++) {
                    const double *node = &node_features[(size_t)mesh->faces[shown.face[k]][j] * D];
                    for (int f = 0; f < D; f++) to[f] += shown.weights[3 * k + j] * node[f];
                }
                to += D;
            }
            double total = 0;
            for (size_t a = 0; a < anchors.size(); a += 2) {
                const double dx = shown.x[k] - anchors[a], dy = shown.y[k] - anchors[a + 1];
                const double weight = 1 / std::max(dx * dx + dy * dy, NEAR);
                total += weight;
                for (int f = 0; f < D; f++) to[f] += anchor_features[a / 2 * D + f] * weight;
            }
            if (!anchors.empty())
                for (int f = 0; f < D; f++) to[f] /= total;
            for (int f = 0; f < netw.dim; f++) input[(size_t)(k - i) * netw.dim + f] = (float)sums[f];
        }
        core().forward(&net, input.data(), netw.values.data(), &entries, count, found.data());
        core().premultiplied(found.data(), netw.channels, count, out + (size_t)4 * i);
    }
}

// MSH-34 and MSH-35.
void Painter::recolour(float *colours, size_t n) const {
    if (!pose.colour.empty())
        for (float *v = colours; v < colours + 4 * n; v += 4) {
            const float before[4] = {v[0], v[1], v[2], v[3]};
            for (int c = 0; c < 3; c++) {
                float mixed = 0;
                for (int k = 0; k < 4; k++) mixed += pose.colour[4 * c + k] / 4096.f * before[k];
                v[c] = std::min(std::max(mixed, 0.f), before[3]);
            }
        }
    if (pose.opacity != 65535) {
        const float opacity = (float)(pose.opacity / 65535.);
        for (size_t i = 0; i < 4 * n; i++) colours[i] *= opacity;
    }
}

}  // namespace pxi
