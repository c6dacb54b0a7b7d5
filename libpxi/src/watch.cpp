#include "watch.h"

#include "parallel.h"

namespace pxi {

static PXI_THREAD_LOCAL const Watch *heard = nullptr;

Listening::Listening(const Watch &watch) : before(heard) { heard = &watch; }
Listening::~Listening() { heard = before; }

int (*Listening::function() const)(int, int) {
    if (!heard->function) return nullptr;
    return [](int done, int all) { return heard->function(heard->user, done, all); };
}

}  // namespace pxi
