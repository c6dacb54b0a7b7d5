// Chapter 9: from layers to pixels.
#pragma once

#include <functional>

#include "image.h"

namespace pxi {

// What is drawn, checked and completed.
struct Request {
    View view;
    std::vector<int> drawn;     // numbers of the layers, back to front
    bool moving = false;
    int64_t time = 0;           // microseconds
    int threads = 1;
    Limits limits;
    bool opaque(const Image &image) const { return image.file->head.opaque && !drawn.empty() && drawn[0] == 0; }
};

// Takes a rectangle of finished pixels: premultiplied [height][width][4], or opaque [height][width][3].
// Called by any thread, of different rectangles at once.
typedef std::function<void(const Box &, const float *, int channels)> Put;

// Tells how much is done, 0..1, and asks whether to stop, which it does by a failure.
typedef std::function<void(double)> Told;

// Draws a picture (REN-1 to REN-11).
void render(Image &image, const Request &request, const Put &put, const Told &told);

}  // namespace pxi
