#include "window.h"

namespace pxi {

Made::Made(Shape shape) : shape(shape) {
    squares = {(shape.rows + 31) >> LOG2, (shape.columns + 31) >> LOG2};
    there.resize(squares.size());
}

std::vector<Window> Made::lacking(Window w) const {
    std::vector<Window> out;
    const int side = 1 << LOG2, bottom = (w.bottom + side - 1) >> LOG2, right = (w.right + side - 1) >> LOG2;
    const int left = w.left >> LOG2;
    const auto row = [&](int y) { return there.begin() + (int64_t)y * squares.columns; };
    for (int y = w.top >> LOG2, end; y < bottom; y = end) {
        for (end = y + 1; end < bottom; end++)  // rows that lack the same
            if (!std::equal(row(y) + left, row(y) + right, row(end) + left)) break;
        for (int x = left; x < right; x++) {
            if (row(y)[x]) continue;
            const int first = x;
            while (x < right && !row(y)[x]) x++;
            out.push_back({y << LOG2, std::min(end << LOG2, shape.rows), first << LOG2,
                           std::min(x << LOG2, shape.columns)});
        }
    }
    return out;
}

void Made::add(Window w) {
    const int side = 1 << LOG2;
    for (int y = w.top >> LOG2; y < (w.bottom + side - 1) >> LOG2; y++) {
        const auto row = there.begin() + (int64_t)y * squares.columns;
        std::fill(row + (w.left >> LOG2), row + ((w.right + side - 1) >> LOG2), 1);
    }
}

bool Made::whole() const { return std::find(there.begin(), there.end(), 0) == there.end(); }

}  // namespace pxi
