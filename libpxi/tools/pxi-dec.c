/* Decodes a .pxi file to PNG: `pxi-dec IN.pxi OUT.png [flags]`. Flags and exit codes are those of pxi-decode. */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "png.h"
#include "pxi.h"
#include "sha256.h"

static const char USAGE[] =
    "usage: pxi-dec IN.pxi OUT.png [--width N] [--height N] [--scale S] [--region X,Y,W,H] [--time S]\n"
    "               [--layer NAME|INDEX].. [--no-background] [--bit-depth 8|16] [--threads N]\n"
    "       pxi-dec --list IN.pxi\n"
    "       pxi-dec --latents IN.pxi\n";

typedef struct {
    const char *in, *out;
    const char **layers;  /* as they were asked for */
    size_t layer_count;
    int list, latents, bits;
    pxi_request request;
} Command;

static int wrong(const char *message, const char *what) {
    fprintf(stderr, "pxi-dec: %s: %s\n%s", message, what, USAGE);
    return PXI_USAGE;
}

/* A whole number from 1 on, or 0 if it is none. */
static uint32_t count_of(const char *text) {
    char *end;
    const long value = strtol(text, &end, 10);
    return *text < '0' || *text > '9' || *end || value < 1 || value > 999999999 ? 0 : (uint32_t)value;
}

static int number_of(const char *text, double *value) {
    char *end;
    *value = strtod(text, &end);
    return *text && !*end && !strpbrk(text, "xXnN");
}

static int region_of(const char *text, pxi_request *request) {
    int end = 0;
    if (strspn(text, "0123456789,") != strlen(text)) return 0;
    sscanf(text, "%8u,%8u,%8u,%8u%n", &request->x, &request->y, &request->region_width, &request->region_height, &end);
    return end && !text[end] && request->region_width && request->region_height;
}

/* Takes a flag with its value; returns what is wrong with that, "" if there is no such flag, or null. */
static const char *flag(Command *c, const char *name, const char *value) {
    pxi_request *r = &c->request;
    if (!strcmp(name, "--width")) return (r->width = count_of(value)) ? NULL : "not a number of pixels";
    if (!strcmp(name, "--height")) return (r->height = count_of(value)) ? NULL : "not a number of pixels";
    if (!strcmp(name, "--scale")) return number_of(value, &r->scale) && r->scale > 0 ? NULL : "not a scale";
    if (!strcmp(name, "--region")) return region_of(value, r) ? NULL : "not a region";
    if (!strcmp(name, "--time")) return r->moving = 1, number_of(value, &r->time) ? NULL : "not a time";
    if (!strcmp(name, "--threads")) return (r->threads = count_of(value)) ? NULL : "not a number of threads";
    if (!strcmp(name, "--layer")) return c->layers[c->layer_count++] = value, NULL;
    if (strcmp(name, "--bit-depth")) return "";
    c->bits = atoi(value);
    return !strcmp(value, "8") || !strcmp(value, "16") ? NULL : "neither 8 nor 16";
}

static int parse(Command *c, int count, char **words) {
    for (int i = 1; i < count; i++) {
        char *word = words[i], *value = strchr(word, '=');
        const char *problem;
        if (!strcmp(word, "--no-background")) {
            c->request.without_background = 1;
        } else if (!strcmp(word, "--list")) {
            c->list = 1;
        } else if (!strcmp(word, "--latents")) {
            c->latents = 1;
        } else if (strncmp(word, "--", 2)) {
            if (c->out) return wrong("a file too many", word);
            *(c->in ? &c->out : &c->in) = word;
        } else {
            if (value) *value++ = 0;
            else value = i + 1 < count ? words[++i] : NULL;
            if (!value) return wrong("no such flag, or it lacks its value", word);
            problem = flag(c, word, value);
            if (problem) return *problem ? wrong(problem, value) : wrong("no such flag", word);
        }
    }
    const int alone = c->list || c->latents;
    return c->in && alone == !c->out ? 0 : wrong("files are missing", alone ? "IN" : "IN and OUT");
}

static void *read_whole(const char *path, size_t *size) {
    FILE *from = fopen(path, "rb");
    unsigned char *bytes = NULL, *more;
    size_t room = 0, got = 1;
    *size = 0;
    while (from && got) {
        if (*size == room) {
            if (!(more = realloc(bytes, room = 2 * room + (1 << 16)))) break;
            bytes = more;
        }
        *size += got = fread(bytes + *size, 1, room - *size, from);
    }
    if (!from || got || ferror(from)) free(bytes), bytes = NULL;
    if (from) fclose(from);
    return bytes;
}

/* Numbers of the layers that were asked for, by name or position. */
static int find_layers(pxi_file *file, Command *c, uint32_t *numbers, pxi_error *error) {
    pxi_info info = PXI_INFO_INIT;
    if (pxi_describe(file, &info, error)) return (int)error->status;
    for (size_t i = 0; i < c->layer_count; i++) {
        const char *key = c->layers[i], *digits = key + (*key == '-');
        const size_t length = strlen(digits);
        uint32_t k = 0;
        if (length && length < 10 && strspn(digits, "0123456789") == length)
            k = *key == '-' ? info.layers - (uint32_t)atol(digits) : (uint32_t)atol(key);
        else
            for (; k < info.layers; k++) {
                pxi_layer layer = PXI_LAYER_INIT;
                if (pxi_describe_layer(file, k, &layer, error)) return (int)error->status;
                if (layer.name_bytes == strlen(key) && !memcmp(layer.name, key, layer.name_bytes)) break;
            }
        if (k >= info.layers) return wrong("there is no such layer", key);
        numbers[i] = k;
    }
    return 0;
}

static int list(pxi_file *file, pxi_error *error) {
    pxi_info info = PXI_INFO_INIT;
    if (pxi_describe(file, &info, error)) return (int)error->status;
    printf("%ux%u, %u layers%s", info.width, info.height, info.layers, info.duration ? ", moving\n" : "\n");
    for (uint32_t k = 0; k < info.layers; k++) {
        pxi_layer layer = PXI_LAYER_INIT;
        if (pxi_describe_layer(file, k, &layer, error)) return (int)error->status;
        printf("%u ", k);
        for (uint32_t i = 0; i < layer.name_bytes; i++) {  /* names may hold anything */
            const unsigned char byte = (unsigned char)layer.name[i];
            if (byte < 32 || byte == 127) printf("\\x%02x", byte);
            else putchar(byte);
        }
        printf("%s%s\n", layer.hidden ? " (hidden)" : "", layer.moves ? " (moves)" : "");
    }
    return 0;
}

/* Prints the SHA-256 of all latents, as little-endian integers of 32 bits. */
static int hash_latents(pxi_file *file, pxi_error *error) {
    Sha256 hash;
    char digits[65];
    size_t count = 0;
    int status = PXI_OK;
    sha256_begin(&hash);
    for (uint32_t plane = 0; pxi_latents(file, plane, NULL, &count, error) == PXI_OK; plane++) {
        int32_t *values = malloc(count * sizeof *values);
        status = values ? (int)pxi_latents(file, plane, values, &count, error) : PXI_MEMORY;
        for (size_t i = 0; !status && i < count; i++) {
            const uint32_t v = (uint32_t)values[i];
            const uint8_t bytes[4] = {(uint8_t)v, (uint8_t)(v >> 8), (uint8_t)(v >> 16), (uint8_t)(v >> 24)};
            sha256_add(&hash, bytes, 4);
        }
        free(values);
        if (status) return status;
    }
    error->status = PXI_OK;  /* there are no more planes */
    sha256_end(&hash, digits);
    puts(digits);
    return PXI_OK;
}

static int write_png(const char *path, const void *pixels, const pxi_output *output, int bits, int threads) {
    FILE *to = fopen(path, "wb");
    int bad = !to || png_write(to, pixels, output->width, output->height, bits, output->opaque ? 3 : 4, threads);
    if (to && fclose(to)) bad = 1;
    if (!bad) return 0;
    fprintf(stderr, "pxi-dec: %s: %s\n", path, strerror(errno));
    if (to) remove(path);
    return PXI_IO;
}

static int decode(pxi_file *file, Command *c, pxi_error *error) {
    pxi_output output = PXI_OUTPUT_INIT;
    uint32_t *numbers = malloc((c->layer_count + 1) * sizeof *numbers);
    void *pixels = NULL;
    int status = numbers ? find_layers(file, c, numbers, error) : PXI_MEMORY;
    c->request.format = c->bits == 16 ? PXI_RGBA16 : PXI_RGBA8;
    if (!c->request.threads) c->request.threads = (uint32_t)sysconf(_SC_NPROCESSORS_ONLN);
    if (c->layer_count) c->request.layers = numbers, c->request.layer_count = c->layer_count;
    if (!status) status = (int)pxi_measure(file, &c->request, &output, error);
    if (!status && !(pixels = malloc(output.bytes))) status = PXI_MEMORY;
    if (!status) status = (int)pxi_render(file, &c->request, pixels, output.bytes, 0, error);
    if (!status) status = write_png(c->out, pixels, &output, c->bits, (int)c->request.threads);
    free(pixels), free(numbers);
    return status;
}

static int run(Command *c, pxi_error *error) {
    size_t size;
    pxi_file *file = NULL;
    void *bytes = read_whole(c->in, &size);
    int status;
    if (!bytes) {
        fprintf(stderr, "pxi-dec: %s: %s\n", c->in, strerror(errno));
        return PXI_IO;
    }
    status = (int)pxi_open(bytes, size, NULL, &file, error);
    free(bytes);
    if (!status) status = c->list ? list(file, error) : c->latents ? hash_latents(file, error) : decode(file, c, error);
    if (error->status) fprintf(stderr, "pxi-dec: %s: %s%s%s\n", c->in, error->message, *error->rule ? ", rule " : "", error->rule);
    else if (status == PXI_MEMORY) fprintf(stderr, "pxi-dec: %s: there is not enough memory\n", c->in);
    pxi_close(file);
    return status == PXI_MEMORY ? PXI_LIMIT : status;
}

int main(int count, char **words) {
    Command c = {NULL, NULL, malloc((size_t)count * sizeof(char *)), 0, 0, 0, 8, PXI_REQUEST_INIT};
    pxi_error error = PXI_ERROR_INIT;
    int status = PXI_LIMIT;
    if (!c.layers) fputs("pxi-dec: there is not enough memory\n", stderr);
    else if (!(status = parse(&c, count, words))) status = run(&c, &error);
    free(c.layers);
    return status;
}
