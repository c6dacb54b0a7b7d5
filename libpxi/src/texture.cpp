#include "texture.h"

#include "hidden.h"
#include "raster.h"

namespace pxi {

struct Shown {
    Scene scene;  // that it was made for, if it depends on one
    std::vector<float> samples;
    int channels;
};

struct Textures::Inner {
    const File &file;
    const std::vector<Boundary> &boundaries;
    const Limits limits;
    Models models;
    std::vector<std::shared_ptr<Raster>> rasters;  // by plan
    std::vector<std::shared_ptr<Shown>> views;      // by layer

    Raster &raster(int plan, const Watch &watch) {
        std::shared_ptr<Raster> &found = rasters[plan];
        const Plan &p = file.plans[plan];
        if (!found) found = std::make_shared<Raster>(p, models.of(p.model), watch);
        return *found;
    }

    // Components of a part of a raster, all of which is made.
    Components components(int plan, const std::array<int, 4> &part, const Watch &watch) {
        const auto &[x, y, w, h] = part;
        const int count = file.plans[plan].components;
        const float *samples = raster(plan, watch).samples(0, {y, y + h, x, x + w});
        Components out(count);
        for (int c = 0; c < count; c++) {
            out[c].resize((size_t)w * h);
            for (int j = 0; j < h; j++)
                for (int i = 0; i < w; i++)
                    out[c][(size_t)j * w + i] =
                        samples[((int64_t)(y + j) * file.plans[plan].width + x + i) * count + c];
        }
        return out;
    }

    Behind behind(const Texr &t, size_t colours, const Watch &watch) {
        const std::array<int, 4> part = {0, 0, t.part[2], t.part[3]};
        Behind out{components(t.behind - 1, part, watch), stored_of(file.plans[t.behind - 1])};
        even_out(out.values, colours);
        if (t.alpha) {
            if (t.behind_alpha)
                out.values.push_back(std::move(components(t.behind_alpha - 1, part, watch)[0]));
            else
                out.values.emplace_back(out.there.size(), 1.f);
        }
        return out;
    }

    std::shared_ptr<Shown> made(int n, const Scene &scene, const Watch &watch);
};

// What layer n shows, all of it.
std::shared_ptr<Shown> Textures::Inner::made(int n, const Scene &scene, const Watch &watch) {
    const Texr &t = file.textures[file.source(n)];
    const int w = t.part[2], h = t.part[3];
    const Masks masks = Occlusion(file, boundaries, limits, scene, n).masks();
    watch.ask();
    Components values = components(t.planes, t.part, watch);
    const bool hides = masks.unmixed || std::find(masks.shown.begin(), masks.shown.end(), 0) != masks.shown.end();
    if (hides) even_out(values, t.behind ? file.plans[t.behind - 1].components : 1);
    const size_t colours = values.size();
    if (t.alpha) values.push_back(std::move(components(t.alpha - 1, t.part, watch)[0]));
    if (hides) {
        Behind others;
        if (t.behind) others = behind(t, colours, watch);
        Components merged = filled(t, values, masks.trusted, t.behind ? &others : nullptr);
        for (size_t c = 0; c < values.size(); c++)
            for (size_t i = 0; i < masks.shown.size(); i++)
                if (masks.shown[i]) merged[c][i] = values[c][i];
        if (masks.unmixed) {
            Components mixed = std::move(values);
            mixed.resize(colours);
            unmix(masks.edge, mixed, merged, w, h);
        }
        values = std::move(merged);
    }
    if (t.matte) {
        if (!t.alpha) values.emplace_back((size_t)w * h, 1.f);
        const Components own = components(t.matte - 1, {0, 0, w, h}, watch);
        for (size_t i = 0; i < masks.soft.size(); i++)
            if (masks.soft[i] && !masks.shown[i]) values.back()[i] *= own[0][i];
    }
    auto out = std::make_shared<Shown>();
    const bool clear = t.alpha || t.matte;
    out->channels = clear ? 4 : 3;
    out->samples.resize((size_t)w * h * out->channels);
    float *to = out->samples.data();
    for (size_t i = 0; i < (size_t)w * h; i++) {
        const float a = clear ? values.back()[i] : 1;
        for (size_t c = 0; c < 3; c++) *to++ = values[std::min(c, colours - 1)][i] * a;
        if (clear) *to++ = a;
    }
    out->scene = scene;
    return out;
}

Textures::Textures(const File &file, const std::vector<Boundary> &boundaries, const Limits &limits, FindModel models)
    : inner(new Inner{file, boundaries, limits, Models(models), {}, {}}) {
    forget();
}
Textures::~Textures() = default;

void Textures::shape(int plan, int level, int *rows, int *columns) const {
    const Plan &p = inner->file.plans[plan];
    const Shape shape = level ? Grid(p).at(level) : Shape{p.height, p.width};
    *rows = shape.rows, *columns = shape.columns;
}

Samples Textures::raster(int plan, int level, Window window) {
    Raster &raster = inner->raster(plan, watch);
    const Shape shape = raster.shape(level);
    return {raster.samples(level, window), shape.rows, shape.columns, inner->file.plans[plan].components,
            inner->rasters[plan]};
}

bool Textures::in_place(int n, const Scene &scene) const {
    return Occlusion(inner->file, inner->boundaries, inner->limits, scene, n).in_place();
}

Samples Textures::view(int n, const Scene &scene, Window window) {
    const Texr &t = inner->file.textures[inner->file.source(n)];
    const auto &[x, y, w, h] = t.part;
    if (!t.alpha && !t.matte && t.cells.empty() && t.cuts.empty()) {  // the raster itself
        Samples out = raster(t.planes, 0, {y + window.top, y + window.bottom, x + window.left, x + window.right});
        out.at += ((int64_t)y * out.columns + x) * out.channels;
        out.rows = h;
        return out;
    }
    std::shared_ptr<Shown> &last = inner->views[n];
    if (!last || (!(last->scene == scene) && (!t.cuts.empty() || t.matte))) last = inner->made(n, scene, watch);
    return {last->samples.data(), h, w, last->channels, last};
}

size_t Textures::latent_count(int plan) const {
    const Grid grid(inner->file.plans[plan]);
    int64_t count = 3 * grid.at(grid.levels).size();
    for (int level = grid.levels; level > 0; level--) count += 9 * grid.at(level).size();
    return (size_t)count;
}

std::vector<int32_t> Textures::latents(int plan) {
    const Plan &p = inner->file.plans[plan];
    Latents latents(p, inner->models.of(p.model), watch);
    const Grid grid(p);
    for (int level = p.levels; level > 0; level--) latents.level(level, Window::whole(grid.at(level)));
    std::vector<int32_t> out = latents.lowest();
    for (int level = p.levels; level > 0; level--) {
        const Shape shape = grid.at(level);
        const int32_t *own = latents.level(level, Window::whole(shape));
        out.insert(out.end(), own, own + 9 * shape.size());
    }
    return out;
}

void Textures::forget() {
    inner->rasters.assign(inner->file.plans.size(), {});
    inner->views.assign(inner->file.layers.size(), {});
}

}  // namespace pxi
