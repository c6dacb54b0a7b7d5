#include "parallel.h"

#ifndef PXI_NO_THREADS
#include <atomic>
#include <exception>
#include <thread>
#include <vector>
#endif

namespace pxi {

#ifdef PXI_NO_THREADS
void parallel(int, int64_t count, Call<void(int64_t)> work) {
    for (int64_t i = 0; i < count; i++) work(i);
}
#else
void parallel(int threads, int64_t count, Call<void(int64_t)> work) {
    std::atomic<int64_t> next{0};
    std::exception_ptr failed;
    Mutex mutex;
    const auto run = [&] {
        try {
            for (int64_t i; (i = next++) < count;) work(i);
        } catch (...) {
            const Lock lock(mutex);
            if (!failed) failed = std::current_exception();
            next = count;
        }
    };
    std::vector<std::thread> others;
    others.reserve(threads > 1 ? threads - 1 : 0);
    for (int k = 1; k < threads && k < count; k++) {
        try {
            others.emplace_back(run);
        } catch (const std::exception &) {  // there are no more, or no memory for one: fewer do it
            break;
        }
    }
    run();
    for (std::thread &other : others) other.join();
    if (failed) std::rethrow_exception(failed);
}
#endif

}  // namespace pxi
