#include <pxi.h>
#include <stdio.h>
#include <stdlib.h>

static int64_t take(void *from, void *buffer, size_t count) { return (int64_t)fread(buffer, 1, count, from); }

int main(void) {
    pxi_file *file = NULL;
    unsigned char *pixels = NULL;
    pxi_error error = PXI_ERROR_INIT;
    pxi_output output = PXI_OUTPUT_INIT;
    pxi_request request = PXI_REQUEST_INIT;
    request.width = 64;
    if (pxi_open_callback(take, stdin, NULL, &file, &error) || pxi_measure(file, &request, &output, &error) ||
        !(pixels = malloc(output.bytes)) || pxi_render(file, &request, pixels, output.bytes, 0, &error))
        return fprintf(stderr, "%s\n", error.message), 1;
    printf("P6 %u %u 255\n", output.width, output.height);
    for (size_t i = 0; i < output.bytes; i += 4) fwrite(pixels + i, 1, 3, stdout);
    pxi_close(file);
    free(pixels);
    return 0;
}
