/* SHA-256 (FIPS 180-4), for tools. */
#ifndef PXI_SHA256_H
#define PXI_SHA256_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    uint32_t state[8];
    uint64_t count; /* bytes so far */
    uint8_t block[64];
} Sha256;

void sha256_begin(Sha256 *s);
void sha256_add(Sha256 *s, const uint8_t *bytes, size_t count);
/* Puts 64 hexadecimal digits and a 0. */
void sha256_end(Sha256 *s, char *digits);

#endif
