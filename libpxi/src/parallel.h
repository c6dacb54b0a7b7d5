// Work on several threads, where there are any: WebAssembly is compiled without (PXI_NO_THREADS).
#pragma once

#include <cstdint>

#include "call.h"

#ifdef PXI_NO_THREADS
namespace pxi {
struct Mutex {};
struct Lock {
    explicit Lock(Mutex &) {}
};
}  // namespace pxi
#else
#include <mutex>
namespace pxi {
typedef std::mutex Mutex;
typedef std::lock_guard<std::mutex> Lock;
}  // namespace pxi
#endif

namespace pxi {

// Calls work(0) .. work(count - 1), on up to so many threads at once. The first failure ends it.
void parallel(int threads, int64_t count, Call<void(int64_t)> work);

}  // namespace pxi
