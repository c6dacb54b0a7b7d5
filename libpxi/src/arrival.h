// Latents of a level that one thread decodes while others use the rows that are there.
#pragma once

#include "watch.h"
#include "window.h"

#ifdef PXI_NO_THREADS
namespace pxi {
class Arrival;
}
#else
#include <condition_variable>
#include <mutex>

namespace pxi {

class Arrival {
    const Watch &outer;
    const Shape shape;
    const int32_t *at = nullptr;
    int rows = 0;
    bool failed = false;
    std::mutex mutex;
    std::condition_variable changed;

    void now(int count, bool fails = false) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (count <= rows && !fails) return;
        rows = std::max(rows, count), failed |= fails;
        changed.notify_all();
    }
    // The loops decode in waves, see native/context.h.
    static int hear(void *self, int done, int all) {
        Arrival &own = *(Arrival *)self;
        own.now((done - own.shape.columns + 3) / 3);
        return own.outer.function ? own.outer.function(own.outer.user, done, all) : 0;
    }

  public:
    Arrival(Shape shape, const Watch &outer) : outer(outer), shape(shape) {}

    // Does the work that all rows come from, of one thread.
    template <class Work> void during(const Work &work) {
        try {
            work();
        } catch (...) {
            now(0, true);
            throw;
        }
        now(shape.rows);
    }
    Watch watch() { return {hear, this, 1}; }                     // what that thread tells
    void begin(const int32_t *latents) { at = latents; }          // [9][rows][columns], as they come
    const int32_t *latents() const { return at; }
    // Waits for so many rows; false if they will never be there.
    bool wait(int count) {
        std::unique_lock<std::mutex> lock(mutex);
        changed.wait(lock, [&] { return failed || rows >= count; });
        return !failed;
    }
};

}  // namespace pxi
#endif
