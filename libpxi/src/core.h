// The loops of the native core (proxyimg_codec/native), compiled once for each level of processors.
#pragma once

#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#endif
#define PXI_LEVEL loops  // a namespace for the structures, which are the same on all levels
#include "native/arrays.h"
#include "native/completion.h"
#include "native/context.h"
#include "native/coverage.h"
#include "native/finish.h"
#include "native/lifting.h"
#include "native/network.h"
#include "native/sample.h"
#include "native/synthesis.h"
#undef PXI_LEVEL
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include "errors.h"

namespace pxi {

// Functions of native/kernel.cpp; see there.
struct Core {
    const char *level;
    int64_t (*decode)(const loops::Coded *);
    int (*pyramid_lowest)(loops::Lowest *);
    int (*pyramid_level)(loops::Level *);
    int (*next_plain)(const loops::Plain *);
    int (*pyramid_synthesis)(const loops::Synthesis *);
    void (*forward)(const Net *, const float *, const float *, const Entries *, int64_t, float *);
    void (*sample)(const float *, int64_t, int32_t, const loops::Points *, float *);
    void (*coloured)(const float *, const float *, int64_t, float *);
    void (*shown)(const float *, const float *, int64_t, float *);
    int (*coverage)(loops::Cover *, const int64_t *, const int64_t *, int64_t);
    int (*diffused)(const loops::Plane *, const uint8_t *);
    int (*completed)(loops::Copies *);
    void (*blend)(float *, float *, const float *, const float *, int64_t);
    void (*premultiplied)(const float *, int32_t, int64_t, float *);
    void (*finished)(const float *, int32_t, int64_t, int32_t, int32_t, void *);
};

// Those of the best level that the processor runs.
const Core &core();

// Refuses what a function of the core says that went wrong.
void check_core(int wrong, const Place &at);

}  // namespace pxi
