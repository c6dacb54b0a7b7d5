// Zstandard frames of metadata (CHK-16, SEC-6).
#include <zstd.h>
#include <zstd_errors.h>

#include <cstring>
#include <memory>

#include "read.h"

namespace pxi {

static const uint8_t MAGIC[] = {0x28, 0xb5, 0x2f, 0xfd};  // other frames are skippable
static const int WINDOW_LOG_MAX = 27;

std::vector<uint8_t> decompressed(Bytes frame, int64_t size, const Place &at, Budget &budget) {
    budget.spend(METADATA_BYTES, size);
    need(frame.size() >= 4 && !std::memcmp(frame.data(), MAGIC, 4), "CHK-16", "metadata is not a zstd frame", at);
    const std::unique_ptr<ZSTD_DCtx, size_t (*)(ZSTD_DCtx *)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
    if (!context) out_of_memory();
    ZSTD_DCtx_setParameter(context.get(), ZSTD_d_windowLogMax, WINDOW_LOG_MAX);
    std::vector<uint8_t> out((size_t)size + 1);
    ZSTD_inBuffer in = {frame.data(), frame.size(), 0};
    ZSTD_outBuffer to = {out.data(), out.size(), 0};
    size_t left = 1;
    while (left && to.pos < to.size) {
        const size_t before = in.pos + to.pos;
        left = ZSTD_decompressStream(context.get(), &to, &in);
        if (ZSTD_isError(left)) {
            if (ZSTD_getErrorCode(left) == ZSTD_error_frameParameter_windowTooLarge)
                fail(Kind::LIMIT, "SEC-6", "the zstd frame needs too large a window", at);
            if (ZSTD_getErrorCode(left) == ZSTD_error_memory_allocation) out_of_memory();
            fail(Kind::INVALID, "CHK-16", "metadata is not a zstd frame", at);
        }
        if (in.pos + to.pos == before) break;
    }
    need(left == 0 && to.pos == (size_t)size, "CHK-16", "metadata does not have the stated size", at);
    need(in.pos == frame.size(), "CHK-16", "bytes follow the zstd frame", at);
    out.resize((size_t)size);
    return out;
}

}  // namespace pxi
