// Threads that share the tasks of one phase after the other.
#pragma once

#include <functional>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "level.h"
#include "threads.h"

namespace PXI_LEVEL {

class Team {
    Barrier sync;
    std::vector<std::thread> others;
    const std::function<void(int)> *task = nullptr;
    std::atomic<int> next{0};
    int count = 0;
    std::atomic<bool> begun{false}, over{false}, failed{false};

    void share() {
        try {
            for (int i; (i = next.fetch_add(1)) < count;) (*task)(i);
        } catch (const std::bad_alloc &) {
            failed = true;
        }
    }
    void work() {
        const FlushDenormals flush;
        begun.wait(false);
        for (;;) {
            sync.wait();
            if (over) return;
            share();
            sync.wait();
        }
    }

  public:
    explicit Team(int threads) {
        try {
            for (int i = 1; i < threads; i++) others.emplace_back(&Team::work, this);
        } catch (const std::system_error &) {
            // No more threads to be had: those that there are do the work.
        }
        sync.threads = (int)others.size() + 1;
        begun = true;
        begun.notify_all();
    }
    ~Team() {
        over = true;
        sync.wait();
        for (auto &thread : others) thread.join();
    }
    // Does tasks 0 .. n - 1, which throw nothing but std::bad_alloc; so does this then.
    void run(int n, const std::function<void(int)> &f) {
        task = &f, count = n, next = 0;
        sync.wait();
        share();
        sync.wait();
        if (failed) throw std::bad_alloc();
    }
};

}  // namespace PXI_LEVEL
