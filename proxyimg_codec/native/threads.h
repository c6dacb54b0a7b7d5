// What threads of training need: to meet, and no denormal numbers.
#pragma once

#include <atomic>

#include "level.h"

#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace PXI_LEVEL {

// Fading moments end as denormal numbers, which are a hundred times slower: treated as zero while
// this object lives, in this thread only.
struct FlushDenormals {
#if defined(__SSE__)
    unsigned mode = _mm_getcsr();
    FlushDenormals() { _mm_setcsr(mode | 0x8040); }
    ~FlushDenormals() { _mm_setcsr(mode); }
#endif
};

// Threads meet twice a step, every millisecond or less: sleeping at once would cost more than the
// work, spinning for long would take the processor from whoever else needs it.
class Barrier {
    std::atomic<int> waiting{0}, round{0};

  public:
    int threads = 1;
    void wait() {
        int now = round.load();
        if (waiting.fetch_add(1) + 1 == threads) {
            waiting.store(0);
            round.store(now + 1);
            round.notify_all();
            return;
        }
        for (int spins = 0; spins < 20000; spins++)
            if (round.load(std::memory_order_relaxed) != now) break;
        while (round.load() == now) round.wait(now);
    }
};

}  // namespace PXI_LEVEL
