// From the bytes of a file to its values.
#pragma once

#include <memory>

#include "limits.h"
#include "model.h"

namespace pxi {

// Reads a file, which is copied, and checks every rule that needs no texture, mesh, pose or motion
// decoded. Networks and planes of codes are decoded. `blocks`: whether to unpack metadata, too.
std::unique_ptr<File> read_file(Bytes data, Budget &budget, bool blocks = true);

// Checks that the values of a file agree, and spends what they will cost to decode (check.cpp).
void check_file(const File &file, Budget &budget);

// Decodes a network into `values` (TEX-14 to TEX-16), and the plane of codes of an implicit texture
// into `features` (TEX-1 to TEX-10); `dim` is the number of features of a code.
void decode_network(Netw &network);
void decode_codes(Texr &texture, int dim);

// Decodes the cells of the mask and of the sources of a view (PYR-39, PYR-48).
void decode_cells(Texr &view);

// The content of one zstd frame (CHK-16), which has `size` bytes.
std::vector<uint8_t> decompressed(Bytes frame, int64_t size, const Place &at, Budget &budget);

}  // namespace pxi
