#include "latent_tables.h"

#include <cmath>
#include <cstdlib>

namespace pxi {

static const int DIRECT = 40, HEAVIER = 8, SCALES = 64, CERTAIN = 4, REACH = 31, SCALE_BITS = 14;

// Decay exp(-1 / (16 b)) of a scale b = exp(s / 8 - 4) in units of 2**-30 (PYR-11).
static const int64_t DECAY[DIRECT + HEAVIER + 1] = {
    35393227, 52851506, 75289240, 102884774, 135529471, 172843597, 214221090, 258892111,
    305991952, 354626758, 403929503, 453102773, 501447535, 548378935, 593431250, 636254580,
    676605816, 714336160, 749376998, 781725510, 811430948, 838582162, 863296692, 885711526,
    905975483, 924243119, 940669972, 955408967, 968607797, 980407102, 990939289, 1000327855,
    1008687096, 1016122104, 1022728986, 1028595212, 1033800083, 1038415237, 1042505208, 1046127973,
    1049335508, 1052174316, 1054685934, 1056907409, 1058871740, 1060608288, 1062143152, 1063499509,
    1064697929,
};
// Largest difference that has a symbol.
static const int REACHES[DIRECT + 1] = {
    2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 4, 4,
    4, 5, 5, 5, 6, 7, 7, 8, 9, 10, 11, 12, 14, 15, 17, 19,
    22, 24, 27, 31, 31, 31, 31, 31, 31,
};

// Powers of a decay in units of 2**-30.
static std::vector<int64_t> powers(int scale) {
    std::vector<int64_t> out = {1 << 30};
    while (out.size() < 16 * (REACH + 2)) out.push_back((out.back() * DECAY[scale] + (1 << 29)) >> 30);
    return out;
}

namespace {

struct Distributions {
    std::vector<uint16_t> ends;
    std::vector<int64_t> reach, shifts;
    loops::Tables tables;

    Distributions() {
        const int columns = 2 * REACH + 3;
        ends.resize((DIRECT + 1) * 16 * columns, 1 << SCALE_BITS);
        for (int scale = 0; scale <= DIRECT; scale++) {
            const std::vector<int64_t> near = powers(scale), wide = powers(scale + HEAVIER);
            for (int part = 0; part < 16; part++) {
                uint16_t *row = ends.data() + (scale * 16 + part) * columns;
                const int most = REACHES[scale];
                const int64_t room = (1 << SCALE_BITS) - 2 * most - 2;
                int64_t first = 0;
                for (int i = 0; i < 2 * most + 2; i++) {
                    const int z = 16 * (i - most) - part;
                    const int64_t tail = 7 * near[std::abs(z)] + wide[std::abs(z)];
                    const int64_t below = z < 0 ? tail : ((int64_t)1 << 34) - tail;
                    if (i == 0) first = below;
                    row[i] = (uint16_t)((((below - first) * room) >> 34) + i);
                }
                reach.push_back(most);
            }
        }
        for (int scale = 0; scale < SCALES; scale++) {  // raw low bits (PYR-10)
            int bits = 0;
            while (scale - (11 * bits + 1) / 2 > DIRECT) bits++;
            shifts.push_back(bits);
        }
        tables = {ends.data(), reach.data(), shifts.data(), columns, SCALES, CERTAIN, LATENT_LIMIT, SCALE_BITS};
    }
};

}  // namespace

const loops::Tables &latent_tables() {
    static const Distributions made;
    return made.tables;
}

const std::vector<int32_t> &log_features() {
    static const std::vector<int32_t> made = [] {
        std::vector<int32_t> out;
        for (int n = 0; n < 53; n++) out.push_back((int32_t)std::lround(32 * std::log(1. + n)));
        return out;
    }();
    return made;
}

}  // namespace pxi
