#include "watch.h"

namespace pxi {

static thread_local const Watch *heard = nullptr;

Listening::Listening(const Watch &watch) : before(heard) { heard = &watch; }
Listening::~Listening() { heard = before; }

int (*Listening::function() const)(int, int) {
    if (!heard->function) return nullptr;
    return [](int done, int all) { return heard->function(heard->user, done, all); };
}

}  // namespace pxi
