// Which of the levels that a library was compiled for the processor runs. Compiled for the baseline.

#include <cstring>

#if defined(__x86_64__) || defined(__i386__)
#define LACKS(feature) \
    if (!__builtin_cpu_supports(feature)) return feature;

// The first instructions of x86-64-v3 that are not there, or null.
static const char *lacks_avx2() {
    LACKS("avx") LACKS("avx2") LACKS("fma") LACKS("bmi") LACKS("bmi2")
    return nullptr;
}
static const char *lacks_avx512() {  // of x86-64-v4
    if (const char *missing = lacks_avx2()) return missing;
    LACKS("avx512f") LACKS("avx512bw") LACKS("avx512cd") LACKS("avx512dq") LACKS("avx512vl")
    return nullptr;
}
static const char *lacking(const char *level) {
    __builtin_cpu_init();
    if (!std::strcmp(level, "avx2")) return lacks_avx2();
    if (!std::strcmp(level, "avx512")) return lacks_avx512();
#if defined(__AVX512F__)
    if (!std::strcmp(level, "native")) return lacks_avx512();
#elif defined(__AVX2__)
    if (!std::strcmp(level, "native")) return lacks_avx2();
#endif
    return nullptr;
}
#else
static const char *lacking(const char *) { return nullptr; }
#endif

// Instructions of a level that the processor lacks, by their name in compilers, or null.
#pragma GCC visibility push(default)
extern "C" const char *pxi_lacking(const char *level) { return lacking(level); }
