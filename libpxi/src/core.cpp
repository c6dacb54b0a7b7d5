#include "core.h"

#include <type_traits>

#define PXI_FUNCTIONS(X)                                                                                    \
    X(decode) X(pyramid_lowest) X(pyramid_level) X(next_plain) X(pyramid_synthesis) X(forward) X(sample)   \
    X(coloured) X(shown) X(coverage) X(diffused) X(completed) X(blend) X(premultiplied) X(finished)

// Symbols of all levels; their types are those of Core.
#define PXI_DECLARE(name, level) extern std::remove_pointer_t<decltype(pxi::Core::name)> pxi_##name##_##level;
#define PXI_BASELINE(name) PXI_DECLARE(name, baseline)
#define PXI_AVX2(name) PXI_DECLARE(name, avx2)
#define PXI_AVX512(name) PXI_DECLARE(name, avx512)
extern "C" {
PXI_FUNCTIONS(PXI_BASELINE)
#ifdef PXI_X86_LEVELS
PXI_FUNCTIONS(PXI_AVX2)
PXI_FUNCTIONS(PXI_AVX512)
const char *pxi_lacking(const char *level);
#endif
}

namespace pxi {

#define PXI_TAKE_BASELINE(name) pxi_##name##_baseline,
#define PXI_TAKE_AVX2(name) pxi_##name##_avx2,
#define PXI_TAKE_AVX512(name) pxi_##name##_avx512,
static constexpr Core BASELINE = {"baseline", PXI_FUNCTIONS(PXI_TAKE_BASELINE)};
#ifdef PXI_X86_LEVELS
static constexpr Core AVX2 = {"avx2", PXI_FUNCTIONS(PXI_TAKE_AVX2)};
static constexpr Core AVX512 = {"avx512", PXI_FUNCTIONS(PXI_TAKE_AVX512)};
#endif

const Core &core() {
#ifdef PXI_X86_LEVELS
    static const Core &best = !pxi_lacking("avx512") ? AVX512 : !pxi_lacking("avx2") ? AVX2 : BASELINE;
    return best;
#else
    return BASELINE;
#endif
}

void check_core(int wrong, const Place &at) {
    using namespace loops;
    need(wrong != STREAM_ENDS, "ENT-6", "a stream ends too early", at);
    need(wrong != ESCAPES_END, "PYR-13", "the list of escapes is cut off or corrupt", at);
    need(wrong != OUT_OF_RANGE, "PYR-12", "a latent is out of range", at);
    if (wrong == STOPPED) fail(Kind::STOPPED, "", "the caller asked to stop");
    if (wrong) out_of_memory();
}

}  // namespace pxi
