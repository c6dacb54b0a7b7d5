#include "mesh.h"

#include <algorithm>
#include <map>

#include "coded.h"
#include "geometry.h"

namespace pxi {

namespace {

enum Symbol { NEW = 1, RANKED = 2, FAR = 15 };

// An edge, or two nodes, as a number; numbers ascend like the pairs.
uint64_t edge(int32_t a, int32_t b) { return (uint64_t)a << 32 | (uint32_t)b; }
uint64_t pair(int32_t a, int32_t b) { return edge(std::min(a, b), std::max(a, b)); }

// The vertices of open gates, each with how many it is a vertex of.
class Open {
    std::vector<int> count, place;

  public:
    std::vector<int> all;
    explicit Open(int vertices) : count(vertices), place(vertices) {}
    void add(int v) {
        if (count[v]++) return;
        place[v] = (int)all.size(), all.push_back(v);
    }
    void drop(int v) {
        if (--count[v]) return;
        place[all.back()] = place[v], all[place[v]] = all.back();
        all.pop_back();
    }
};

// Lattice points and triangles of a base (MSH-3 to MSH-9).
class Base {
    const Mesh &mesh;
    std::vector<uint8_t> symbols;
    std::vector<int32_t> residuals;
    size_t used = 0, used_far = 0;
    int known = 0;
    std::map<uint64_t, int32_t> edges;  // directed; the third vertex of those that are open gates, -1 of others
    std::vector<uint64_t> queue;
    Open open;

  public:
    std::vector<int32_t> points;
    std::vector<Face> triangles;

    explicit Base(const Mesh &m)
        : mesh(m), symbols(decode_array(m.symbols, 1, 1, m.gates, 4, nullptr, m.at)),
          residuals(decode_signed(m.classes, m.deltas, 2, 1, m.vertices, m.at)), open(m.vertices),
          points((size_t)2 * m.vertices) {
        while (used < symbols.size()) {
            const int a = vertex(0, 0, nullptr);
            const int b = vertex(points[2 * a], points[2 * a + 1], nullptr);
            add(a, b, vertex(points[2 * b], points[2 * b + 1], nullptr));
            pass_gates();
        }
        need(known == m.vertices, "MSH-9", "a mesh does not use all its vertices", m.at);
        need(used_far == m.far.size(), "MSH-9", "far vertices of a mesh are left over", m.at);
    }

  private:
    void corrupt(bool ok, const char *rule) const { need(ok, rule, "the connectivity of a mesh is corrupt", mesh.at); }

    int64_t area(int a, int b, int c) const {
        const int32_t *p = &points[2 * a], *q = &points[2 * b], *r = &points[2 * c];
        return (int64_t)(q[0] - p[0]) * (r[1] - p[1]) - (int64_t)(q[1] - p[1]) * (r[0] - p[0]);
    }

    void pass_gates() {
        for (size_t at = 0; at < queue.size(); at++) {
            const int32_t gate[2] = {(int32_t)(queue[at] >> 32), (int32_t)queue[at]};
            int32_t &third = edges[queue[at]];
            const int x = gate[0], y = gate[1], n = third;
            if (n < 0) continue;
            close(x, y, third);
            const int32_t *p = points.data();
            const int z = vertex(p[2 * x] + p[2 * y] - p[2 * n], p[2 * x + 1] + p[2 * y + 1] - p[2 * n + 1], gate);
            if (z >= 0) add(y, x, z);
        }
        queue.clear();
    }

    // The vertex that the next symbol names, -1 for none; `gate` is null at the start of a part.
    int vertex(int across, int down, const int32_t *gate) {
        corrupt(used < symbols.size(), "MSH-5");
        const int symbol = symbols[used++];
        if (symbol == NEW) {
            corrupt(known < mesh.vertices, "MSH-7");
            const int v = known++;
            points[2 * v] = (across + residuals[v]) & 255;
            points[2 * v + 1] = (down + residuals[mesh.vertices + v]) & 255;
            return v;
        }
        if (symbol == FAR) {
            corrupt(used_far < mesh.far.size() && mesh.far[used_far] < known, "MSH-7");
            return mesh.far[used_far++];
        }
        corrupt(gate, "MSH-5");
        return symbol < RANKED ? -1 : ranked(symbol - RANKED, across, down, gate);
    }

    int ranked(int rank, int across, int down, const int32_t *gate) const {  // MSH-8
        typedef std::pair<int64_t, int> Far;
        Far best[FAR];
        int count = 0;
        for (const int v : open.all) {
            const int64_t dx = points[2 * v] - across, dy = points[2 * v + 1] - down;
            const Far far = {dx * dx + dy * dy, v};
            if (count > rank && best[rank] < far) continue;
            if (area(gate[1], gate[0], v) <= 0) continue;
            int k = std::min(count, rank);
            for (; k && far < best[k - 1]; k--) best[k] = best[k - 1];
            best[k] = far;
            count = std::min(count + 1, rank + 1);
        }
        corrupt(count > rank, "MSH-8");
        return best[rank].second;
    }

    void add(int a, int b, int c) {  // MSH-6
        need(area(a, b, c) > 0, "MSH-2", "a triangle of a mesh is not positive", mesh.at);
        const int at[5] = {a, b, c, a, b};
        for (int i = 0; i < 3; i++) {
            const int x = at[i], y = at[i + 1];
            const auto [own, fresh] = edges.insert({edge(x, y), -1});
            need(fresh, "MSH-2", "triangles of a mesh overlap", mesh.at);
            const auto back = edges.find(edge(y, x));
            if (back == edges.end()) {
                own->second = at[i + 2];
                queue.push_back(edge(x, y));
                open.add(x), open.add(y);
            } else if (back->second >= 0) {
                close(y, x, back->second);
            }
        }
        triangles.push_back({a, b, c});
    }

    void close(int x, int y, int32_t &third) {
        third = -1;
        open.drop(x), open.drop(y);
    }
};

typedef std::map<uint64_t, int32_t> Middles;  // nodes between two others

struct Child {  // a triangle, and the one of the base that it is a part of
    int home;
    Face t;
};

int32_t between(const Middles &middles, int32_t a, int32_t b) {
    const auto found = middles.find(pair(a, b));
    return found == middles.end() ? -1 : found->second;
}

void four(const Child &whole, const Middles &middles, std::vector<Child> &out) {  // MSH-13
    const auto [a, b, c] = whole.t;
    const int32_t d = between(middles, a, b), e = between(middles, b, c), f = between(middles, c, a);
    for (const Face &t : {Face{a, d, f}, Face{d, b, e}, Face{f, e, c}, Face{d, e, f}}) out.push_back({whole.home, t});
}

void add_middles(const std::vector<Child> &split, Middles &middles, Refined &to) {  // MSH-12
    for (const Child &child : split)
        for (int i = 0; i < 3; i++) middles.insert({pair(child.t[i], child.t[(i + 1) % 3]), -1});
    for (auto &[p, middle] : middles) {
        if (middle >= 0) continue;
        const int32_t a = (int32_t)(p >> 32), b = (int32_t)p;
        middle = to.count();
        for (int axis = 0; axis < 2; axis++) to.nodes.push_back((to.nodes[2 * a + axis] + to.nodes[2 * b + axis]) >> 1);
        to.ends.push_back(a), to.ends.push_back(b);
    }
}

// Divides a triangle of which some edges are halved (MSH-14, MSH-15).
void divide(const Child &child, const int32_t *halves, int count, const Middles &middles, std::vector<Child> &out) {
    if (count == 3) return four(child, middles, out);
    int turn = 0;
    while ((halves[turn] >= 0) != (count == 1)) turn++;
    if (count == 2) turn = (turn + 1) % 3;
    const int32_t a = child.t[turn], b = child.t[(turn + 1) % 3], c = child.t[(turn + 2) % 3];
    const int32_t d = halves[turn], e = halves[(turn + 1) % 3];
    if (count == 1)
        for (const Face &t : {Face{a, d, c}, Face{d, b, c}}) out.push_back({child.home, t});
    else
        for (const Face &t : {Face{d, b, e}, Face{a, d, c}, Face{d, e, c}}) out.push_back({child.home, t});
}

std::vector<Face> closed(std::vector<Child> triangles, int homes, const Middles &middles) {
    std::vector<Child> found;
    while (!triangles.empty()) {
        std::vector<Child> parts[3];
        for (const Child &child : triangles) {
            int32_t halves[3], count = 0;
            for (int i = 0; i < 3; i++) {
                halves[i] = between(middles, child.t[i], child.t[(i + 1) % 3]);
                count += halves[i] >= 0;
            }
            if (count)
                divide(child, halves, count, middles, parts[count - 1]);
            else
                found.push_back(child);
        }
        triangles = std::move(parts[0]);
        for (int i = 1; i < 3; i++) triangles.insert(triangles.end(), parts[i].begin(), parts[i].end());
    }
    // By homes; those of one home stay in their order.
    std::vector<size_t> next(homes + 1);
    for (const Child &child : found) next[child.home + 1]++;
    for (int k = 0; k < homes; k++) next[k + 1] += next[k];
    std::vector<Face> out(found.size());
    for (const Child &child : found) out[next[child.home]++] = child.t;
    return out;
}

}  // namespace

Refined decode_mesh(const Mesh &mesh, Budget &budget) {
    Refined out;
    Middles middles;
    std::vector<Child> whole, triangles, split;
    int homes;
    {
        const Base base(mesh);
        for (size_t i = 0; i < base.points.size(); i++)
            out.nodes.push_back((int64_t)1024 * mesh.origin[i & 1] + (int64_t)base.points[i] * mesh.step[i & 1]);
        for (size_t i = 0; i < base.points.size(); i++) out.ends.push_back((int32_t)(i >> 1));
        homes = (int)base.triangles.size();
        for (int i = 0; i < homes; i++) triangles.push_back({i, base.triangles[i]});
    }
    size_t next = 0;
    for (int level = 0; level < mesh.levels; level++) {
        budget.spend(FACES, 4 * (int64_t)triangles.size());
        const Bytes data = take_array(mesh.splits, &next, "MSH-11", mesh.at);
        const auto flags = decode_array(data, 1, 1, (int)triangles.size(), 1, nullptr, mesh.at);
        split.clear();
        for (size_t i = 0; i < triangles.size(); i++) (flags[i] ? split : whole).push_back(triangles[i]);
        need(!split.empty(), "MSH-11", "a refinement of a mesh splits nothing", mesh.at);
        add_middles(split, middles, out);
        triangles.clear();
        for (const Child &child : split) four(child, middles, triangles);
    }
    need(next == mesh.splits.size(), "MSH-11", "split flags are left over", mesh.at);
    whole.insert(whole.end(), triangles.begin(), triangles.end());
    out.faces = closed(std::move(whole), homes, middles);
    return out;
}

}  // namespace pxi
