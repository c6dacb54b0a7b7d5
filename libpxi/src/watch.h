// Whether the caller wants to stop, and how many threads work.
#pragma once

#include "errors.h"

namespace pxi {

// Asks now and then, from any thread that works; `function` may be null. `done` of `all` is the work of
// one step.
struct Watch {
    int (*function)(void *user, int done, int all) = nullptr;
    void *user = nullptr;
    int threads = 1;  // that may work
    void ask(int done = 0, int all = 1) const {
        if (function && function(user, done, all)) fail(Kind::STOPPED, "", "the caller asked to stop");
    }
};

}  // namespace pxi
