#include "pose.h"

#include <algorithm>
#include <bit>
#include <cstdlib>

#include "coded.h"

namespace pxi {

namespace {

constexpr int64_t POINT_MAX = 1 << 30, NODE_MAX = 1 << 24, PIECE = 4096, WEIGHT_MAX = 1 << 20;
constexpr int PIECES_LOG2_MAX = 6, GRID_BITS = 22;
constexpr size_t RUN = 48;  // control points that are located together

// The path with its segments divided into pieces (MSH-25), whose control points are blossoms.
Path divided(const Path &path) {
    Path out;
    for (size_t k = 0; k < path.size(); k += 6) {
        int64_t p[4][2], extent = 0;
        for (int axis = 0; axis < 2; axis++) {
            int64_t low = INT64_MAX, high = INT64_MIN;
            for (int i = 0; i < 4; i++) {
                const int64_t v = p[i][axis] = path[(k + 2 * i) % path.size() + axis];
                low = std::min(low, v), high = std::max(high, v);
            }
            extent = std::max(extent, high - low);
        }
        int log2 = 0;
        while (log2 < PIECES_LOG2_MAX && extent > PIECE << log2) log2++;
        const int64_t n = 1 << log2;
        for (int64_t i = 0; i < n; i++)
            for (int point = 0; point < 3; point++) {
                const int64_t s = i, t = i + (point > 1), u = i + (point > 0), a = n - s, b = n - t, c = n - u;
                const int64_t w[4] = {a * b * c, s * b * c + a * t * c + a * b * u,
                                      s * t * c + s * b * u + a * t * u, s * t * u};
                for (int axis = 0; axis < 2; axis++) {
                    int64_t sum = 0;
                    for (int j = 0; j < 4; j++) sum += w[j] * p[j][axis];
                    out.push_back(sum >> (3 * log2));
                }
            }
    }
    return out;
}

// Moves control points with the nodes of a mesh (MSH-26 to MSH-29).
class Rider {
    const Refined &mesh;
    const Points &moves;
    int64_t low[2] = {INT64_MAX, INT64_MAX};
    int shift = 0;
    Points grid, sums;  // of nodes; of the corners of each face

    int64_t side(int a, int b, const int64_t *p) const {
        const int64_t *from = &grid[2 * a], *to = &grid[2 * b];
        return (to[0] - from[0]) * (p[1] - from[1]) - (to[1] - from[1]) * (p[0] - from[0]);
    }
    bool holds(const Face &f, const int64_t *p) const {
        return side(f[0], f[1], p) >= 0 && side(f[1], f[2], p) >= 0 && side(f[2], f[0], p) >= 0;
    }

    // Numbers of the faces, in order, whose rectangles meet that of some points.
    std::vector<int> near(const int64_t *at, size_t count) const {
        int64_t least[2] = {INT64_MAX, INT64_MAX}, most[2] = {INT64_MIN, INT64_MIN};
        for (size_t i = 0; i < 2 * count; i++)
            least[i & 1] = std::min(least[i & 1], at[i]), most[i & 1] = std::max(most[i & 1], at[i]);
        std::vector<int> found;
        for (size_t f = 0; f < mesh.faces.size(); f++) {
            const auto [a, b, c] = mesh.faces[f];
            bool meets = true;
            for (int k = 0; k < 2; k++) {
                const int64_t u = grid[2 * a + k], v = grid[2 * b + k], w = grid[2 * c + k];
                meets &= std::min({u, v, w}) <= most[k] && std::max({u, v, w}) >= least[k];
            }
            if (meets) found.push_back((int)f);
        }
        return found;
    }

    void move(int64_t *point, const int64_t *at, const Face &face) const {
        const auto [a, b, c] = face;
        const int64_t whole = std::max<int64_t>(side(a, b, &grid[2 * c]), 1);
        const auto share = [&](int64_t side) {
            return std::clamp(floored<int64_t>(65536 * side, whole), -WEIGHT_MAX, WEIGHT_MAX);
        };
        const int64_t wb = share(side(c, a, at)), wc = share(side(a, b, at)), wa = 65536 - wb - wc;
        for (int k = 0; k < 2; k++)
            point[k] += (wa * moves[2 * a + k] + wb * moves[2 * b + k] + wc * moves[2 * c + k] + 32768) >> 16;
    }

  public:
    Rider(const Refined &m, const Points &by) : mesh(m), moves(by), grid(m.nodes) {
        int64_t high[2] = {INT64_MIN, INT64_MIN};
        for (size_t i = 0; i < grid.size(); i++)
            low[i & 1] = std::min(low[i & 1], grid[i]), high[i & 1] = std::max(high[i & 1], grid[i]);
        const uint64_t extent = (uint64_t)std::max(high[0] - low[0], high[1] - low[1]);
        shift = std::max((int)std::bit_width(extent) - GRID_BITS, 0);
        for (size_t i = 0; i < grid.size(); i++) grid[i] = (grid[i] - low[i & 1]) >> shift;
        for (const Face &f : mesh.faces)
            for (int k = 0; k < 2; k++) sums.push_back(grid[2 * f[0] + k] + grid[2 * f[1] + k] + grid[2 * f[2] + k]);
    }

    void moved(std::vector<Path> &paths, const Budget &budget) const {
        int64_t count = 0, lost = 0;
        for (const Path &path : paths) count += (int64_t)path.size() / 2;
        const int64_t faces = (int64_t)mesh.faces.size();
        budget.check(BEYOND, (count + (int64_t)RUN - 1) / (int64_t)RUN * faces);
        Points at;
        for (Path &path : paths)
            for (size_t first = 0; first < path.size(); first += 2 * RUN) {
                const size_t end = std::min(first + 2 * RUN, path.size());
                at.clear();
                for (size_t i = first; i < end; i++)
                    at.push_back(std::clamp<int64_t>((path[i] - low[i & 1]) >> shift, -((int64_t)1 << GRID_BITS),
                                                     (int64_t)1 << (GRID_BITS + 1)));
                const std::vector<int> some = near(at.data(), at.size() / 2);
                for (size_t i = 0; i < at.size(); i += 2) {
                    int face = -1;
                    for (const int f : some)
                        if (holds(mesh.faces[f], &at[i])) {
                            face = f;
                            break;
                        }
                    if (face < 0) {
                        budget.check(BEYOND, (lost += faces));
                        face = nearest<int64_t>(sums, 3 * at[i], 3 * at[i + 1]);
                    }
                    move(&path[first + i], &at[i], mesh.faces[face]);
                }
            }
    }
};

}  // namespace

void predict(int32_t *values, const Refined &mesh) {
    for (int i = 0; i < mesh.count(); i++) {
        const int p = mesh.ends[2 * i], q = mesh.ends[2 * i + 1];
        // Sums of a broken file may leave 32 bits; what they become is out of range, or no matter.
        if (p != i)
            values[i] = (int32_t)((uint32_t)values[i] + (uint32_t)(((int64_t)values[p] + values[q]) >> 1));
        else if (i)
            values[i] = (int32_t)((uint32_t)values[i] + (uint32_t)values[i - 1]);
    }
}

Points displacements(const Pose &pose, Bytes classes, Bytes deltas, const Refined *mesh) {
    Points out;
    if (classes.empty()) return out;
    const int count = mesh->count();
    std::vector<int32_t> rows = decode_signed(classes, deltas, 2, 1, count, pose.at);
    predict(rows.data(), *mesh), predict(rows.data() + count, *mesh);
    bool some = false;
    for (int i = 0; i < 2 * count; i++) {
        const int64_t v = rows[(i & 1) * count + i / 2];
        need(std::abs(v) < NODE_MAX, "MSH-19", "a displacement is out of range", pose.at);
        some |= v != 0;
        out.push_back(v);
    }
    need(some, "MSH-19", "displacements are all zero", pose.at);
    return out;
}

Points mapped(const Pose &pose, Points points) {
    if (pose.identity()) return points;
    const auto [a, b, c, d] = pose.matrix;
    for (size_t i = 0; i < points.size(); i += 2) {
        const int64_t x = std::clamp(points[i], -POINT_MAX, POINT_MAX), y = std::clamp(points[i + 1], -POINT_MAX, POINT_MAX);
        points[i] = ((a * x + c * y + (1 << 23)) >> 24) + pose.shift[0];
        points[i + 1] = ((b * x + d * y + (1 << 23)) >> 24) + pose.shift[1];
    }
    return points;
}

Outline outline(const Outline &at_rest, const Head &head, const Pose &pose, const Points &moves, const Refined *mesh,
                const Budget &budget) {
    if (pose.identity() && moves.empty()) return at_rest;
    Outline out = {at_rest.paths, 10};
    int up = 10 - at_rest.unit;
    if (out.paths.empty()) {
        const int64_t w = head.width, h = head.height, corners[5][2] = {{0, 0}, {w, 0}, {w, h}, {0, h}, {0, 0}};
        Path path;
        for (int i = 0; i < 4; i++)
            for (const int k : {i, i, i + 1}) path.push_back(corners[k][0]), path.push_back(corners[k][1]);
        out.paths = {path}, up = 10;
    }
    for (Path &path : out.paths)
        for (int64_t &v : path) v *= (int64_t)1 << up;
    if (!moves.empty()) {
        for (Path &path : out.paths) path = divided(path);
        Rider(*mesh, moves).moved(out.paths, budget);
    }
    for (Path &path : out.paths) path = mapped(pose, std::move(path));
    return out;
}

}  // namespace pxi
