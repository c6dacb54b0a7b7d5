/* Writer of PNG files, for tools. */
#ifndef PXI_PNG_H
#define PXI_PNG_H

#include <stdint.h>
#include <stdio.h>

/*
 * Writes pixels of 4 samples of 8 or 16 bits, 16 in the order of the machine, as PNG of 3 or 4 channels: the
 * fourth sample is left out of 3. If `threads` is more than 1, two pack them. Returns 0 if all was written.
 */
int png_write(FILE *to, const void *pixels, uint32_t width, uint32_t height, int bits, int channels,
              int threads);

#endif
