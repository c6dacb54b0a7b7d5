#include "errors.h"

#include <new>

namespace pxi {

#if __cpp_exceptions
void fail(Kind kind, const char *rule, const char *message, const Place &at) {
    throw Failure{kind, rule, message, at};
}
void out_of_memory() { throw std::bad_alloc(); }
#else
// The host of a WebAssembly module: it takes note, and gives the instance up.
extern "C" [[noreturn]] __attribute__((import_module("pxi"), import_name("failed"))) void pxi_failed(
    int kind, const char *rule, const char *message, const char *chunk, int64_t offset);
void fail(Kind kind, const char *rule, const char *message, const Place &at) {
    pxi_failed((int)kind, rule, message, at.chunk, at.offset);
}
void out_of_memory() { fail(Kind::LIMIT, "", "there is not enough memory"); }
#endif

__attribute__((noinline)) void need(bool ok, const char *rule, const char *message, const Place &at) {
    if (!ok) fail(Kind::INVALID, rule, message, at);
}
__attribute__((noinline)) void supported(bool ok, const char *rule, const char *message, const Place &at) {
    if (!ok) fail(Kind::UNSUPPORTED, rule, message, at);
}
__attribute__((noinline)) void usage(bool ok, const char *message) {
    if (!ok) fail(Kind::USAGE, "", message);
}

}  // namespace pxi
