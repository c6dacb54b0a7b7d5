// Why a file is refused, or a request. Inside the library a failure is thrown; nothing is thrown over
// the border of the C interface, which catches all in one place.
#pragma once

#include <cstdint>
#include <string>

namespace pxi {

enum class Kind {  // values are the exit codes of the tools
    USAGE = 2,     // the request makes no sense
    IO = 3,        // a callback of the caller failed
    INVALID = 4,   // the file breaks a rule
    UNSUPPORTED = 5,
    LIMIT = 6,     // the file or the request exceeds a limit, or memory is short
    STOPPED = 7,   // the caller asked to stop
};

struct Place {            // of what is wrong in a file
    const char *chunk = "";   // type of the chunk, or empty: the file as a whole
    int64_t offset = -1;      // of the chunk in the file, in bytes; -1 if it is not known
};

struct Failure {
    Kind kind;
    const char *rule;  // id of the broken rule, such as "CON-7", or empty
    std::string message;
    Place at;
};

// Throws; without exceptions (WebAssembly) it calls `pxi_failed` of the host, which never returns.
[[noreturn]] void fail(Kind kind, const char *rule, const char *message, const Place &at = {});

// Throws as `new` does; ends the instance without exceptions.
[[noreturn]] void out_of_memory();

// Refuse the file as invalid, or a file or a request, unless `ok`. Not inlined: they stand everywhere.
void need(bool ok, const char *rule, const char *message, const Place &at = {});
void supported(bool ok, const char *rule, const char *message, const Place &at = {});
void usage(bool ok, const char *message);

}  // namespace pxi
