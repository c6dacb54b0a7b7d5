// Windows of planes, and memory for planes of which only windows are made.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <vector>

#include "errors.h"

namespace pxi {

// Of each level of a pyramid: the samples, up to 8 levels, and what is above the coarsest.
template <class Item> using ByLevel = std::array<Item, 10>;

struct Shape {
    int rows, columns;
    int64_t size() const { return (int64_t)rows * columns; }
    bool operator==(const Shape &) const = default;
};

struct Window {  // rows top .. bottom - 1 and columns left .. right - 1
    int top, bottom, left, right;

    static Window whole(Shape shape) { return {0, shape.rows, 0, shape.columns}; }
    static Window whole(int rows, int columns) { return {0, rows, 0, columns}; }
    int rows() const { return bottom - top; }
    int columns() const { return right - left; }
    Shape shape() const { return {rows(), columns()}; }
    bool operator==(const Window &) const = default;

    // With more rows and columns on all sides, as far as a plane of a shape has them.
    Window grown(int by, Shape shape) const {
        return {std::max(top - by, 0), std::min(bottom + by, shape.rows), std::max(left - by, 0),
                std::min(right + by, shape.columns)};
    }
    // Of the next coarser plane, over this one; of the next finer one, of a shape, under this one.
    Window halved() const { return {top / 2, (bottom + 1) / 2, left / 2, (right + 1) / 2}; }
    Window doubled(Shape shape) const {
        return {2 * top, std::min(2 * bottom, shape.rows), 2 * left, std::min(2 * right, shape.columns)};
    }
    bool meets(const Window &other) const {
        return std::max(top, other.top) < std::min(bottom, other.bottom) &&
               std::max(left, other.left) < std::min(right, other.right);
    }
    // In an array of an outer window.
    Window inside(const Window &outer) const {
        return {top - outer.top, bottom - outer.top, left - outer.left, right - outer.left};
    }
};

// Zeros, which take no memory before they are written: systems hand out pages then.
template <class T> class Zeros {
    struct Free {
        void operator()(T *p) const { std::free(p); }
    };
    std::unique_ptr<T[], Free> items;

  public:
    void make(int64_t count) {
        items.reset((T *)std::calloc((size_t)count, sizeof(T)));
        if (!items) out_of_memory();
    }
    void clear() { items.reset(); }
    explicit operator bool() const { return (bool)items; }
    T *data() const { return items.get(); }
    T &operator[](int64_t i) const { return items[i]; }
};

// Copies a window of each of `count` planes of a shape; items have `depth` numbers.
template <class T> std::vector<T> cut(const T *from, int count, Shape shape, Window w, int depth = 1) {
    std::vector<T> out;
    out.reserve((size_t)count * w.shape().size() * depth);
    for (int c = 0; c < count; c++)
        for (int y = w.top; y < w.bottom; y++) {
            const T *row = from + ((c * (int64_t)shape.rows + y) * shape.columns + w.left) * depth;
            out.insert(out.end(), row, row + (int64_t)w.columns() * depth);
        }
    return out;
}

// Puts what is at a window of planes of a shape to a window of others, of the same size.
template <class T> void paste(const T *from, Shape from_shape, Window at, T *to, Shape to_shape, Window to_at,
                              int count, int depth = 1) {
    for (int c = 0; c < count; c++)
        for (int y = 0; y < at.rows(); y++) {
            const T *row = from + ((c * (int64_t)from_shape.rows + at.top + y) * from_shape.columns + at.left) * depth;
            std::copy_n(row, (int64_t)at.columns() * depth,
                        to + ((c * (int64_t)to_shape.rows + to_at.top + y) * to_shape.columns + to_at.left) * depth);
        }
}

// Squares of a plane that are made.
class Made {
    static constexpr int LOG2 = 5;  // of the side of a square
    Shape shape = {}, squares = {};
    std::vector<uint8_t> there;

  public:
    Made() = default;
    explicit Made(Shape shape);
    // Windows, in whole squares, that together lack nothing else of a window.
    std::vector<Window> lacking(Window window) const;
    void add(Window window);  // one of `lacking`
    bool whole() const;
};

}  // namespace pxi
