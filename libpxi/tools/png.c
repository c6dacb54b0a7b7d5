#include "png.h"

#include <stdlib.h>
#include <string.h>

#ifdef PXI_ZLIB
#include <zlib.h>
#endif

typedef struct {
    FILE *to;
    uint32_t crc;
} Writer;

#ifndef PXI_ZLIB
static uint32_t crc32(uint32_t crc, const uint8_t *bytes, size_t count) {
    for (crc = ~crc; count--; bytes++) {
        crc ^= *bytes;
        for (int k = 0; k < 8; k++) crc = crc & 1 ? 0xEDB88320u ^ crc >> 1 : crc >> 1;
    }
    return ~crc;
}
#endif

static void put(Writer *w, const void *bytes, size_t count) {
    w->crc = (uint32_t)crc32(w->crc, bytes, count);
    fwrite(bytes, 1, count, w->to);
}

static void number(uint8_t *to, uint32_t n) {
    for (int i = 0; i < 4; i++) to[i] = (uint8_t)(n >> (24 - 8 * i));
}

static void chunk(Writer *w, const char *kind, const void *bytes, uint32_t count) {
    uint8_t word[4];
    number(word, count);
    fwrite(word, 1, 4, w->to);
    w->crc = 0;
    put(w, kind, 4), put(w, bytes, count);
    number(word, w->crc);
    fwrite(word, 1, 4, w->to);
}

/* A row with its filter, 0 (none) or 1 (differences from the pixel before), as PNG wants it: big-endian. */
static void filtered(const uint8_t *from, uint32_t width, int bits, int channels, int filter, uint8_t *to) {
    const int bytes = bits / 8, step = channels * bytes;
    uint8_t *row = to + 1;
    *to = (uint8_t)filter;
    for (uint32_t x = 0; x < width; x++)
        for (int c = 0; c < channels; c++) {
            uint16_t wide;
            if (bits == 8) {
                *row++ = from[4 * x + c];
            } else {
                memcpy(&wide, from + 8 * (size_t)x + 2 * c, 2);
                *row++ = (uint8_t)(wide >> 8), *row++ = (uint8_t)wide;
            }
        }
    if (filter)
        for (row--; row > to + step; row--) *row = (uint8_t)(*row - row[-step]);
}

#ifdef PXI_ZLIB
static int pack(Writer *w, const uint8_t *pixels, uint32_t width, uint32_t height, int bits, int channels) {
    const size_t size = (size_t)width * channels * (bits / 8) + 1, room = 1 << 16;
    uint8_t *row = malloc(size), *out = malloc(room);
    z_stream z;
    memset(&z, 0, sizeof z);
    if (!row || !out || deflateInit2(&z, 1, Z_DEFLATED, 15, 9, Z_RLE) != Z_OK) return free(row), free(out), -1;
    for (uint32_t y = 0; y <= height; y++) {
        if (y < height) {
            filtered(pixels + (size_t)y * width * 4 * (bits / 8), width, bits, channels, 1, row);
            z.next_in = row, z.avail_in = (uInt)size;
        }
        do {
            z.next_out = out, z.avail_out = (uInt)room;
            deflate(&z, y < height ? Z_NO_FLUSH : Z_FINISH);
            if (z.avail_out < room) chunk(w, "IDAT", out, (uint32_t)(room - z.avail_out));
        } while (!z.avail_out);
    }
    deflateEnd(&z), free(row), free(out);
    return 0;
}
#else
/* A zlib stream of blocks that are stored as they are, one a row. */
static int pack(Writer *w, const uint8_t *pixels, uint32_t width, uint32_t height, int bits, int channels) {
    const size_t size = (size_t)width * channels * (bits / 8) + 1, most = 65535;
    uint8_t *row = malloc(size), *out = malloc(most + 11);
    uint32_t a = 1, b = 0;
    if (!row || !out) return free(row), free(out), -1;
    for (uint32_t y = 0; y < height; y++) {
        filtered(pixels + (size_t)y * width * 4 * (bits / 8), width, bits, channels, 0, row);
        for (size_t i = 0; i < size; i++) a = (a + row[i]) % 65521, b = (b + a) % 65521;
        for (size_t at = 0; at < size;) {
            const size_t count = size - at < most ? size - at : most, end = at + count;
            uint8_t *to = out;
            if (!y && !at) *to++ = 0x78, *to++ = 1;
            *to++ = y + 1 == height && end == size;
            *to++ = (uint8_t)count, *to++ = (uint8_t)(count >> 8);
            *to++ = (uint8_t)~count, *to++ = (uint8_t)(~count >> 8);
            memcpy(to, row + at, count);
            to += count;
            if (y + 1 == height && end == size) number(to, b << 16 | a), to += 4;
            chunk(w, "IDAT", out, (uint32_t)(to - out));
            at = end;
        }
    }
    free(row), free(out);
    return 0;
}
#endif

int png_write(FILE *to, const void *pixels, uint32_t width, uint32_t height, int bits, int channels) {
    Writer w = {to, 0};
    uint8_t head[13];
    fwrite("\x89PNG\r\n\x1a\n", 1, 8, to);
    number(head, width), number(head + 4, height);
    head[8] = (uint8_t)bits, head[9] = channels == 4 ? 6 : 2, head[10] = head[11] = head[12] = 0;
    chunk(&w, "IHDR", head, 13);
    if (pack(&w, pixels, width, height, bits, channels)) return -1;
    chunk(&w, "IEND", "", 0);
    return ferror(to) ? -1 : 0;
}
