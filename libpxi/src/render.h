// Chapter 9: from layers to pixels.
#pragma once

#include "call.h"
#include "image.h"
#include "output.h"

namespace pxi {

// What is drawn, checked and completed.
struct Request {
    View view;
    std::vector<int> drawn;     // numbers of the layers, back to front
    bool moving = false;
    int64_t time = 0;           // microseconds
    int threads = 1;
    bool draft = false;         // of as few levels as a thumbnail can be seen in
    Limits limits;
    bool opaque(const Image &image) const { return image.file->head.opaque && !drawn.empty() && drawn[0] == 0; }
};

// Tells how much is done, 0..1, and asks whether to stop, which it does by a failure.
typedef Call<void(double)> Told;

// Draws a picture (REN-1 to REN-11).
void render(Image &image, const Request &request, const Pixels &to, Told told);

}  // namespace pxi
