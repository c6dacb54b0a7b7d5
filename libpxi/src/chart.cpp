#include "chart.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace pxi {

namespace {

constexpr int SAMPLES_MAX = 64;  // of a pixel, across and down

// What a row of samples meets of a triangle, from where to where.
struct Span {
    double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();
    void meet(double centre, const double *p, const double *q) {
        // The two triangles of an edge have to run along it in the same direction.
        if (p[1] > q[1] || (p[1] == q[1] && p[0] > q[0])) std::swap(p, q);
        if (!(centre >= p[1] && centre < q[1])) return;
        const double x = p[0] + (centre - p[1]) * ((q[0] - p[0]) / (q[1] - p[1]));
        low = std::min(low, x), high = std::max(high, x);
    }
};

int64_t first_from(double at, int64_t low, int64_t high) {  // the first centre that is not before a point
    return (int64_t)std::clamp(std::ceil(at - .5), (double)low, (double)high);
}

}  // namespace

View::View(const std::array<int, 4> &r, int w, int h)
    : region(r), width(w), height(h), sx((int)std::min<int64_t>(((int64_t)r[2] + w - 1) / w, SAMPLES_MAX)),
      sy((int)std::min<int64_t>(((int64_t)r[3] + h - 1) / h, SAMPLES_MAX)) {}

Chart::Chart(const Pose &p, const Points &moves, const Points &shown, const Refined *m, bool w)
    : pose(p), mesh(w || !moves.empty() || !shown.empty() ? m : nullptr), weighs(w) {
    // Exact, because in floating point the determinant of a map that is not singular can become 0.
    const auto [a, b, c, d] = p.matrix;
    const double whole = (double)(a * d - b * c), unit = 1 << 24;  // products of less than 2**62 (POS-2)
    inverse[0] = d * unit / whole, inverse[1] = -c * unit / whole;
    inverse[2] = -b * unit / whole, inverse[3] = a * unit / whole;
    for (int k = 0; k < 2; k++) shift[k] = p.shift[k] / 1024.;
    if (!mesh) return;
    Points present = mesh->nodes;
    for (size_t i = 0; i < moves.size(); i++) present[i] += moves[i];
    present = mapped(p, std::move(present));
    for (const Face &face : mesh->faces)
        for (const int32_t node : face)
            for (int k = 0; k < 2; k++) {
                const size_t i = 2 * (size_t)node + k;
                corners.push_back(present[i] / 1024.);
                places.push_back(mesh->nodes[i] / 1024. + (shown.empty() ? 0 : shown[i] / 16.));
            }
    prepare();
}

// In each face, the offset from a point to the one that it shows is affine in the point. Offsets instead of
// positions keep points that did not move exactly where they were.
void Chart::prepare() {
    for (size_t f = 0; f < mesh->faces.size(); f++) {
        const double *p = &corners[6 * f], *r = &places[6 * f], size = area(p), safe = size != 0 ? size : 1;
        const double by_b[2] = {(p[5] - p[1]) / safe, (p[0] - p[4]) / safe};
        const double by_c[2] = {(p[1] - p[3]) / safe, (p[2] - p[0]) / safe};
        for (int k = 0; k < 2; k++) {
            centres.push_back(size != 0 ? (p[k] + p[k + 2] + p[k + 4]) / 3 : std::numeric_limits<double>::infinity());
            const double own = r[k] - p[k], to_b = r[k + 2] - p[k + 2] - own, to_c = r[k + 4] - p[k + 4] - own;
            const double by_x = to_b * by_b[0] + to_c * by_c[0], by_y = to_b * by_b[1] + to_c * by_c[1];
            for (const double v : {own - by_x * p[0] - by_y * p[1], by_x, by_y}) away.push_back(v);
        }
    }
}

std::vector<int32_t> Chart::faces(const View &view, const Box &box, Budget &budget) const {
    const double scale[2] = {view.columns() / (double)view.region[2], view.rows() / (double)view.region[3]};
    const bool turned = pose.matrix[0] * pose.matrix[3] < pose.matrix[1] * pose.matrix[2];
    std::vector<double> at(corners.size());
    for (size_t i = 0; i < at.size(); i++) at[i] = (corners[i] - view.region[i & 1]) * scale[i & 1];
    // Of several faces the one that is drawn last wins: of those that are upright, the first.
    std::vector<int32_t> order[2], out((size_t)box.size(), -1);
    for (size_t f = 0; f < mesh->faces.size(); f++) {
        const double size = area(&at[6 * f]);
        if (size != 0) order[(size > 0) != turned].push_back((int32_t)f);
    }
    int64_t covered = 0;
    budget.spend(MULTIPLY_ADDS, (int64_t)mesh->faces.size() * SAMPLE_COST);
    for (std::vector<int32_t> &some : order)
        for (size_t i = some.size(); i-- > 0;) {
            const double *p = &at[6 * (size_t)some[i]];
            if (std::max({p[0], p[2], p[4]}) <= box.x || std::min({p[0], p[2], p[4]}) >= (double)box.x + box.width) continue;
            const int64_t top = first_from(std::min({p[1], p[3], p[5]}), box.y, (int64_t)box.y + box.height);
            const int64_t end = first_from(std::max({p[1], p[3], p[5]}), box.y, (int64_t)box.y + box.height);
            int64_t held = std::max<int64_t>(end - top - 1, 0);  // rows count, too, less one a face
            for (int64_t row = top; row < end; row++) {
                Span span;
                for (int k = 0; k < 3; k++) span.meet(row + .5, p + 2 * k, p + 2 * ((k + 1) % 3));
                if (!(span.low <= span.high)) continue;
                const int64_t first = first_from(span.low, box.x, (int64_t)box.x + box.width);
                const int64_t last = first_from(span.high, box.x, (int64_t)box.x + box.width);
                int32_t *to = out.data() + (row - box.y) * box.width - box.x;
                std::fill(to + first, to + std::max(first, last), some[i]);
                held += std::max<int64_t>(last - first, 0);
            }
            covered += held;
            budget.spend(MULTIPLY_ADDS, held * SAMPLE_COST);
            budget.check(OVERLAP, covered / box.size());
        }
    return out;
}

Located Chart::locate(const double *x, const double *y, const int32_t *face, size_t n, Budget &budget) const {
    Located out;
    out.x.resize(n), out.y.resize(n);
    if (!mesh) {
        for (size_t i = 0; i < n; i++) {
            const double u = x[i] - shift[0], v = y[i] - shift[1];
            out.x[i] = inverse[0] * u + inverse[1] * v, out.y[i] = inverse[2] * u + inverse[3] * v;
        }
        return out;
    }
    if (weighs) out.face.resize(n), out.weights.resize(3 * n);
    for (size_t i = 0; i < n; i++) {
        int f = face[i];
        if (f < 0) {
            budget.spend(BEYOND, (int64_t)mesh->faces.size());
            f = nearest(centres, x[i], y[i]);
        }
        const double *v = &away[6 * (size_t)f], *p = &corners[6 * (size_t)f];
        out.x[i] = x[i] + (v[0] + v[1] * x[i] + v[2] * y[i]), out.y[i] = y[i] + (v[3] + v[4] * x[i] + v[5] * y[i]);
        if (!weighs) continue;
        const double size = area(p), safe = size != 0 ? size : 1, u = x[i] - p[0], w = y[i] - p[1];
        const double b = ((p[5] - p[1]) * u - (p[4] - p[0]) * w) / safe;
        const double c = ((p[2] - p[0]) * w - (p[3] - p[1]) * u) / safe;
        out.face[i] = f;
        out.weights[3 * i] = 1 - b - c, out.weights[3 * i + 1] = b, out.weights[3 * i + 2] = c;
    }
    return out;
}

}  // namespace pxi
