// Framing of a file: prefix, and chunks with their checksums and order (chapter 2).
#pragma once

#include <vector>

#include "limits.h"
#include "model.h"

namespace pxi {

struct Chunk {
    Place at;  // whose `chunk` is the type, where it is a known one
    Bytes payload;
};

struct Framed {
    int minor;  // version
    std::vector<Chunk> chunks;  // known ones, in order; without TAIL
};

// All known chunks of a file, checked up to CON-13.
Framed read_chunks(Bytes data, Budget &budget);

}  // namespace pxi
