#include "chunks.h"

#include <array>
#include <cstring>
#include <set>

namespace pxi {

static const uint8_t SIGNATURE[] = {0x89, 'P', 'X', 'I', '\r', '\n', 0x1a, '\n'};
static const int MINORS[] = {1, 2, 3, 9, 10, 11, 12};
static const size_t PREFIX = 12;

namespace {

// Ranks of chunks (CON-11). What is not single may come any number of times.
struct Known {
    const char *type;
    int rank, early;  // since version 0.12, and before
    bool single;
};
static const Known KNOWN[] = {
    {"HEAD", 0, 0, true},  {"LAYR", 1, 1, false}, {"MESH", 2, 2, false}, {"POSE", 3, 3, false},
    {"NETW", 4, 4, false}, {"TEXR", 5, 6, false}, {"PLAN", 6, 5, false}, {"iCCp", 7, 7, true},
    {"eXIf", 7, 7, true},  {"xMPd", 7, 7, true},  {"cICp", 7, 7, true},  {"iNFO", 7, 7, true},
    {"tREE", 7, 7, true},  {"mOTN", 7, 7, true},  {"uNDO", 7, 7, true},  {"TAIL", 8, 8, true},
};

static uint32_t u32(Bytes data, size_t at) {
    return data[at] | data[at + 1] << 8 | data[at + 2] << 16 | (uint32_t)data[at + 3] << 24;
}

// CRC-32 of ISO 3309 (CON-6), eight bytes at a time.
class Crc {
    uint32_t tables[8][256];

  public:
    Crc() {
        for (uint32_t n = 0; n < 256; n++) {
            uint32_t c = n;
            for (int k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >> 1) : c >> 1;
            tables[0][n] = c;
        }
        for (int t = 1; t < 8; t++)
            for (int n = 0; n < 256; n++)
                tables[t][n] = tables[t - 1][n] >> 8 ^ tables[0][tables[t - 1][n] & 255];
    }
    uint32_t of(Bytes data) const {
        uint32_t crc = 0xffffffff;
        size_t i = 0;
        for (; i + 8 <= data.size(); i += 8) {
            const uint32_t low = u32(data, i) ^ crc, high = u32(data, i + 4);
            crc = 0;
            for (int k = 0; k < 4; k++)
                crc ^= tables[7 - k][low >> 8 * k & 255] ^ tables[3 - k][high >> 8 * k & 255];
        }
        for (; i < data.size(); i++) crc = tables[0][(crc ^ data[i]) & 255] ^ crc >> 8;
        return ~crc;
    }
};

}  // namespace

static int version_of(Bytes data) {
    const size_t there = std::min(data.size(), sizeof SIGNATURE);
    need(there && !std::memcmp(data.data(), SIGNATURE, there), "CON-2", "this is no .pxi file");
    need(data.size() >= PREFIX, "CON-2", "the file is shorter than its prefix");
    bool known = false;
    for (const int minor : MINORS) known |= data[9] == minor;
    supported(data[8] == 0 && known, "CON-3", "the version of the format is not known");
    need(data[10] == 0 && data[11] == 0, "CON-2", "the reserved field is not 0");
    return data[9];
}

static bool letter(int c) { return (c | 32) >= 'a' && (c | 32) <= 'z'; }

static const Known *known(const uint8_t *type) {
    for (const Known &k : KNOWN)
        if (!std::memcmp(k.type, type, 4)) return &k;
    return nullptr;
}

Framed read_chunks(Bytes data, Budget &budget) {
    budget.spend(FILE_BYTES, (int64_t)data.size());
    Framed out{version_of(data), {}};
    const Crc crc;
    std::set<const Known *> seen;
    int rank = 0;
    int64_t count = 0;
    size_t next = PREFIX;
    bool tail = false;
    for (; next < data.size(); count++) {
        Place at{"", (int64_t)next};
        need(!tail, "CON-13", "bytes follow the last chunk", at);
        budget.check(CHUNKS, count + 1);
        need(data.size() - next >= 12, "CON-7", "the file ends in a chunk", at);
        const uint8_t *type = data.data() + next;
        bool letters = type[2] < 'a';
        for (int k = 0; k < 4; k++) letters &= letter(type[k]);
        need(letters, "CON-8", "a type is not four letters with the third upper case", at);
        const Known *kind = known(type);
        if (kind) at.chunk = kind->type;
        const uint32_t length = u32(data, next + 4);
        need(length < 1u << 31 && length <= data.size() - next - 12, "CON-7",
             "a chunk runs past the end of the file", at);
        need(u32(data, next + 8 + length) == crc.of(data.subspan(next, 8 + length)), "CON-6",
             "the CRC is wrong: the file is damaged", at);
        next += 12 + length;
        need(count || (kind && kind->rank == 0), "CON-11", "the first chunk is not HEAD", at);
        if (!kind) {
            supported(type[0] >= 'a', "CON-9", "a critical chunk is not known", at);
            continue;
        }
        const int own = out.minor < 12 ? kind->early : kind->rank;
        need(own >= rank, "CON-11", "a chunk stands too late", at);
        need(!kind->single || seen.insert(kind).second, "CON-11", "a chunk comes twice", at);
        rank = own, tail = kind->rank == 8;
        if (tail)
            need(length == 0, "CON-11", "TAIL is not empty", at);
        else
            out.chunks.push_back({at, data.subspan(next - 4 - length, length)});
    }
    need(tail, "CON-13", "the file ends without TAIL", {"", (int64_t)next});
    return out;
}

}  // namespace pxi
