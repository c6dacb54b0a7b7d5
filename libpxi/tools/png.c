#include "png.h"

#include <stdlib.h>
#include <string.h>

#ifdef PXI_ZLIB
#include <pthread.h>
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
enum { PARTS = 4 };

typedef struct { /* rows that are packed by themselves */
    const uint8_t *pixels;
    uint32_t width, rows;
    int bits, channels, last;
    uint8_t *out; /* a raw stream of deflate, which ends at a whole byte */
    size_t size, length; /* of it, and of the rows */
    uLong adler;
    int failed;
} Part;

static void *pack_part(void *given) {
    Part *p = given;
    const size_t row = (size_t)p->width * p->channels * (p->bits / 8) + 1;
    z_stream z;
    uint8_t *all = malloc(row * p->rows + 1);
    memset(&z, 0, sizeof z);
    p->length = row * p->rows, p->adler = adler32(0, NULL, 0);
    p->failed = !all || p->length > UINT32_MAX / 2 || deflateInit2(&z, 1, Z_DEFLATED, -15, 9, Z_RLE) != Z_OK;
    if (p->failed) return free(all), NULL;
    for (uint32_t y = 0; y < p->rows; y++)
        filtered(p->pixels + (size_t)y * p->width * 4 * (p->bits / 8), p->width, p->bits, p->channels, 1, all + y * row);
    const size_t room = deflateBound(&z, p->length) + 16;
    p->out = malloc(room);
    z.next_in = all, z.avail_in = (uInt)p->length, z.next_out = p->out, z.avail_out = (uInt)room;
    if (p->out) deflate(&z, p->last ? Z_FINISH : Z_SYNC_FLUSH);
    p->failed = !p->out || z.avail_in;
    p->size = room - z.avail_out, p->adler = adler32(p->adler, all, (uInt)p->length);
    deflateEnd(&z), free(all);
    return NULL;
}

static int pack(Writer *w, const uint8_t *pixels, uint32_t width, uint32_t height, int bits, int channels,
                int threads) {
    const uint8_t head[2] = {0x78, 1};
    uint8_t tail[4];
    Part parts[PARTS];
    pthread_t beside[PARTS];
    int started[PARTS] = {0}, failed = 0;
    uLong adler = adler32(0, NULL, 0);
    chunk(w, "IDAT", head, 2);
    for (int k = 0; k < PARTS; k++) {
        const uint32_t top = (uint32_t)((uint64_t)height * k / PARTS), end = (uint32_t)((uint64_t)height * (k + 1) / PARTS);
        parts[k] = (Part){pixels + (size_t)top * width * 4 * (bits / 8), width, end - top, bits, channels, k == PARTS - 1,
                          NULL, 0, 0, 0, 0};
        if (k % 2 && threads > 1) started[k] = !pthread_create(&beside[k], NULL, pack_part, &parts[k]);
    }
    for (int k = 0; k < PARTS; k++)
        if (!started[k]) pack_part(&parts[k]);
    for (int k = 0; k < PARTS; k++) {
        if (started[k]) pthread_join(beside[k], NULL);
        failed |= parts[k].failed;
        if (!failed) chunk(w, "IDAT", parts[k].out, (uint32_t)parts[k].size);
        adler = adler32_combine(adler, parts[k].adler, (z_off_t)parts[k].length);
        free(parts[k].out);
    }
    number(tail, (uint32_t)adler);
    chunk(w, "IDAT", tail, 4);
    return failed ? -1 : 0;
}
#else
/* A zlib stream of blocks that are stored as they are, one a row. */
static int pack(Writer *w, const uint8_t *pixels, uint32_t width, uint32_t height, int bits, int channels,
                int threads) {
    (void)threads;
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

int png_write(FILE *to, const void *pixels, uint32_t width, uint32_t height, int bits, int channels, int threads) {
    Writer w = {to, 0};
    uint8_t head[13];
    fwrite("\x89PNG\r\n\x1a\n", 1, 8, to);
    number(head, width), number(head + 4, height);
    head[8] = (uint8_t)bits, head[9] = channels == 4 ? 6 : 2, head[10] = head[11] = head[12] = 0;
    chunk(&w, "IHDR", head, 13);
    if (pack(&w, pixels, width, height, bits, channels, threads)) return -1;
    chunk(&w, "IEND", "", 0);
    return ferror(to) ? -1 : 0;
}
