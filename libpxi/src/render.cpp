#include "render.h"

#include <algorithm>
#include <memory>

#include "core.h"
#include "painter.h"
#include "thumbnail.h"

namespace pxi {

namespace {

constexpr int64_t TILE_SAMPLES = 1 << 16;  // drawn at a time: bounds memory, and keeps it in the cache

// Hears of the work of all threads, one at a time.
class Progress {
    const Told told;
    Mutex mutex;
    double done = 0;
    static constexpr double SHARE = .75;  // of decoding

  public:
    explicit Progress(Told t) : told(t) {}
    void at(double share) {
        const Lock lock(mutex);
        done = std::max(done, share);
        told(std::min(done, 1.));
    }
    void drawn(int64_t pixels, int64_t all, double before) { at(before + (1 - before) * pixels / (double)all); }
    static int decoding(void *self, int part, int all) {
        ((Progress *)self)->at(SHARE * std::clamp(part / (double)std::max(all, 1), 0., 1.));
        return 0;
    }
    double so_far() const { return done; }
};

// Textures tell it what they do as long as this lives.
struct Heard {
    Textures &textures;
    const Watch before;
    Heard(Textures &t, Progress &progress, int threads) : textures(t), before(t.watch) {
        t.watch = {Progress::decoding, &progress, threads};
    }
    ~Heard() { textures.watch = before; }
};

// Whether nothing shows through a layer where its boundary covers all.
bool solid(const Image &image, int n, bool in_place) {
    const Texr &texr = image.file->textures[image.file->source(n)];
    if (texr.coder != PYRAMID) return true;
    const int k = image.file->source(n);
    const bool own = std::find(texr.cuts.begin(), texr.cuts.end(), k) != texr.cuts.end();
    return !texr.alpha && !(texr.matte && !(own && in_place));
}

// Samples of a rectangle, premultiplied [height][width][4].
class Tile {
    std::vector<float> clear, colours, coverage;
    std::vector<int32_t> at;
    std::vector<float> some;

  public:
    std::vector<float> result;

    void draw(std::vector<std::unique_ptr<Painter>> &painters, const Box &box, Budget &budget) {
        result.assign((size_t)4 * box.size(), 0), clear.assign((size_t)box.size(), 1);
        for (const auto &painter : painters) {
            int64_t start;
            const bool partly = painter->cover(box, coverage, &start, budget);
            const int64_t count = partly ? (int64_t)coverage.size() : box.size();
            at.clear();
            for (int64_t i = 0; i < count; i++)
                if (clear[start + i] > 0 && (!partly || coverage[i] > 0)) at.push_back((int32_t)(start + i));
            if (at.empty()) continue;
            if ((int64_t)at.size() == count) {
                colours.resize((size_t)4 * count);
                painter->paint(box, at, colours.data(), budget);
            } else {
                some.resize(4 * at.size());
                painter->paint(box, at, some.data(), budget);
                colours.assign((size_t)4 * count, 0);
                for (size_t i = 0; i < at.size(); i++) std::copy_n(&some[4 * i], 4, &colours[4 * (at[i] - start)]);
            }
            core().blend(&result[4 * start], &clear[start], colours.data(), partly ? coverage.data() : nullptr, count);
        }
    }

    // Replaces the samples by their means over squares of sx by sy.
    void average(const Box &box, int sx, int sy) {
        if (sx * sy == 1) return;
        const int width = box.width / sx, height = box.height / sy;
        for (int y = 0; y < height; y++)
            for (int x = 0; x < width; x++) {
                float sum[4] = {};
                for (int j = 0; j < sy; j++) {
                    const float *from = &result[4 * ((size_t)(y * sy + j) * box.width + (size_t)x * sx)];
                    for (int i = 0; i < 4 * sx; i++) sum[i & 3] += from[i];
                }
                for (int c = 0; c < 4; c++) result[4 * ((size_t)y * width + x) + c] = sum[c] / (float)(sx * sy);
            }
    }
};

void compose(Canvas &canvas, std::vector<std::unique_ptr<Painter>> &painters, const Pixels &to, Progress &progress,
             Budget &budget) {
    const View &view = canvas.request.view;
    const int64_t pixel = (int64_t)view.sx * view.sy;
    const int wide = (int)std::max<int64_t>(std::min<int64_t>(view.width, TILE_SAMPLES / pixel), 1);
    const int high = (int)std::max<int64_t>(TILE_SAMPLES / (wide * pixel), 1);
    const int64_t across = (view.width + wide - 1) / wide, down = (view.height + high - 1) / high;
    Mutex mutex;
    std::vector<std::unique_ptr<Tile>> tiles;  // that no thread uses now
    int64_t drawn = 0;
    double before = -1;
    parallel(canvas.request.threads, across * down, [&](int64_t k) {
        const int column = (int)(k % across) * wide, row = (int)(k / across) * high;
        const int w = std::min(wide, view.width - column), h = std::min(high, view.height - row);
        const Box box = {column * view.sx, row * view.sy, w * view.sx, h * view.sy};
        Budget own(budget.limits);  // of this tile, in what is left
        std::unique_ptr<Tile> tile;
        {
            const Lock lock(mutex);
            if (!tiles.empty()) tile = std::move(tiles.back()), tiles.pop_back();
            for (const Limit limit : {WORK, MULTIPLY_ADDS, BEYOND}) own.limits.at[limit] = budget.left(limit);
        }
        if (!tile) tile = std::make_unique<Tile>();
        tile->draw(painters, box, own);
        tile->average(box, view.sx, view.sy);
        to.put({column, row, w, h}, tile->result.data(), 4);
        int64_t done;
        {
            const Lock lock(mutex);
            tiles.push_back(std::move(tile));
            for (const Limit limit : {WORK, MULTIPLY_ADDS, BEYOND})
                budget.spend(limit, own.limits.at[limit] - own.left(limit));
            done = drawn += (int64_t)w * h;
            if (before < 0) before = progress.so_far();  // what was decoded for the first tile
        }
        progress.drawn(done, (int64_t)view.width * view.height, before);
    });
}

}  // namespace

void render(Image &image, const Request &request, const Pixels &to, Told told) {
    const View &view = request.view;
    Budget budget(request.limits);
    budget.spend(OUTPUT_PIXELS, (int64_t)view.width * view.height);
    // In double precision, which does not overflow; what is not exact is beyond all limits.
    const double cost = (double)request.drawn.size() * (double)view.columns() * (double)view.rows() * SAMPLE_COST;
    budget.spend(MULTIPLY_ADDS, (int64_t)std::min(cost, 0x1p62));
    Progress progress(told);
    const Heard heard(*image.textures, progress, request.threads);
    Canvas canvas{image, request, {}, {}, {}, {}};
    const size_t count = image.file->layers.size();
    canvas.scene = {std::vector<uint8_t>(count), request.moving}, canvas.seen.resize(count);
    for (const int n : request.drawn) canvas.scene.drawn[n] = 1;
    canvas.sway.resize(count);
    if (request.moving) canvas.sway = image.motion->at(request.time, count);
    progress.at(0);
    bool all_solid = true, at_rest = true;
    for (const int n : request.drawn) {
        const Texr &texr = image.file->textures[image.file->source(n)];
        const bool in_place = texr.coder != PYRAMID || image.textures->in_place(n, canvas.scene);
        all_solid &= solid(image, n, in_place), at_rest &= in_place;
        canvas.seen[n] = in_place && texr.mask.empty() && !texr.matte;
    }
    if (!all_solid) std::fill(canvas.seen.begin(), canvas.seen.end(), 0);
    else if (at_rest && thumbnail(image, request, to, [&](double share) { progress.at(share); })) return;
    std::vector<std::unique_ptr<Painter>> painters;  // front to back
    for (auto n = request.drawn.rbegin(); n != request.drawn.rend(); n++)
        painters.push_back(std::make_unique<Painter>(canvas, *n, budget));
    compose(canvas, painters, to, progress, budget);
}

}  // namespace pxi
