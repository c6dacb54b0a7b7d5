/*
 * libpxi: a decoder of .pxi files, from C.
 *
 *     pxi_file *file = NULL;
 *     pxi_error error = PXI_ERROR_INIT;
 *     if (pxi_open(bytes, size, NULL, &file, &error)) puts(error.message);
 *
 * Every function that can fail returns a status, 0 if it succeeded, and fills the error that its
 * last argument points to, which may be null. Nothing is printed, no file is opened, no exception
 * leaves the library, and there is no global state: different files may be used by different
 * threads at once, one file by one thread at a time.
 *
 * Structures begin with `size`, which a caller sets to what sizeof tells (PXI_..._INIT does): fields that are added
 * later come at the end, and a caller that was compiled before them gets their defaults, which are
 * zeros. Constants and fields never change their meaning while PXI_ABI stays the same.
 */
#ifndef PXI_H
#define PXI_H

#include <stddef.h>
#include <stdint.h>

#define PXI_ABI 1

#if defined(_WIN32)
#define PXI_API
#else
#define PXI_API __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef struct pxi_file pxi_file;

/* Why a call failed. The first six are the exit codes of pxi-decode, too. */
typedef enum pxi_status {
    PXI_OK = 0,
    PXI_USAGE = 2,       /* the caller asks for what makes no sense: an argument or field is wrong */
    PXI_IO = 3,          /* the callback that reads failed */
    PXI_INVALID = 4,     /* the file breaks a rule of the format */
    PXI_UNSUPPORTED = 5, /* the file is of a newer version, or its model is not there */
    PXI_LIMIT = 6,       /* the file, or the picture that is asked for, exceeds a limit */
    PXI_CANCELLED = 7,   /* the progress callback asked to stop */
    PXI_MEMORY = 8       /* there is not enough memory */
} pxi_status;

typedef struct pxi_error {
    uint32_t size;
    uint32_t status;   /* what the function returned */
    int64_t offset;    /* of the byte in the file that is wrong; -1 if that is not known */
    char rule[16];     /* id of the rule of the specification, such as "CON-7"; may be empty */
    char message[240]; /* for people, in UTF-8 */
} pxi_error;
#define PXI_ERROR_INIT {sizeof(pxi_error), 0, -1, {0}, {0}}

/* Called again and again with how much is done, in 0..1, by one thread at a time, which need not be
 * the caller's if it asks for several. What is not 0 ends the call with PXI_CANCELLED. */
typedef int (*pxi_progress)(void *context, double share);

/* A limit other than the default, by its name in chapter 13 of the specification: "samples" ... */
typedef struct pxi_limit {
    const char *name;
    uint64_t value;
} pxi_limit;

typedef struct pxi_options {
    uint32_t size;
    uint32_t limit_count;
    const pxi_limit *limits;
    /* Finds the bytes of a registered model by the name of its file, such as "pyramid-1.bin", which
     * have to stay until that call ends, and returns 0. Without it, the models are those that are
     * built into the library. It may be called whenever the file is drawn. */
    int (*model)(void *context, const char *name, const void **bytes, size_t *count);
    void *model_context;
    pxi_progress progress; /* while the file is opened */
    void *progress_context;
} pxi_options;
#define PXI_OPTIONS_INIT {sizeof(pxi_options), 0, NULL, NULL, NULL, NULL, NULL}

/* PXI_ABI of the library. */
PXI_API uint32_t pxi_abi(void);

/*
 * Opens a file in memory and checks it. The bytes are copied.
 *
 * `options` may be null. `*out` is null after a failure.
 */
PXI_API pxi_status pxi_open(const void *bytes, size_t count, const pxi_options *options, pxi_file **out,
                            pxi_error *error);

/*
 * Opens a file that a callback reads from its start to its end, into memory of the library.
 *
 * `read` puts up to `count` bytes into `buffer` and returns how many, 0 at the end, or a negative
 * number if it fails.
 */
PXI_API pxi_status pxi_open_callback(int64_t (*read)(void *context, void *buffer, size_t count), void *context,
                                     const pxi_options *options, pxi_file **out, pxi_error *error);

/* Closes a file and frees all that it holds; null is ignored. */
PXI_API void pxi_close(pxi_file *file);

typedef struct pxi_info {
    uint32_t size;
    uint32_t width, height; /* of the canvas in pixels */
    uint32_t opaque;        /* 1 if the back layer covers the canvas */
    uint32_t depth;         /* bits a sample of the original: 8 or 16 */
    uint32_t layers;
    uint32_t metadata;      /* number of blocks */
    uint32_t duration;      /* of the motion in milliseconds; 0 if the picture is still */
    uint32_t fps;           /* frames a second that the motion was made for */
    uint32_t loop;          /* 1 if the motion repeats */
    uint32_t primaries, transfer; /* colour by the code points of ITU-T H.273; 0: not said, sRGB */
} pxi_info;
#define PXI_INFO_INIT {sizeof(pxi_info), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}

PXI_API pxi_status pxi_describe(const pxi_file *file, pxi_info *info, pxi_error *error);

typedef struct pxi_layer {
    uint32_t size;
    uint32_t hidden;     /* 1 if it is drawn only when it is asked for */
    uint32_t moves;      /* 1 if the motion moves it */
    uint32_t name_bytes;
    const char *name;    /* UTF-8, ends with a 0; as long as the file is open. May hold anything */
    int32_t x, y;        /* the rectangle of its texture at rest, in canvas pixels */
    uint32_t width, height;
} pxi_layer;
#define PXI_LAYER_INIT {sizeof(pxi_layer), 0, 0, 0, NULL, 0, 0, 0, 0}

/* Layer `number`, counted from 0 from back to front. */
PXI_API pxi_status pxi_describe_layer(const pxi_file *file, uint32_t number, pxi_layer *layer, pxi_error *error);

typedef struct pxi_metadata {
    uint32_t size;
    char kind[12];      /* "icc", "exif" or "xmp" */
    size_t count;
    const void *bytes;  /* as long as the file is open */
} pxi_metadata;
#define PXI_METADATA_INIT {sizeof(pxi_metadata), {0}, 0, NULL}

/* Block `number` of the metadata. The blocks of a file that is otherwise sound may be damaged. */
PXI_API pxi_status pxi_describe_metadata(const pxi_file *file, uint32_t number, pxi_metadata *block, pxi_error *error);

/* Samples of a pixel: red, green, blue and straight alpha. */
typedef enum pxi_format {
    PXI_RGBA8 = 0,  /* uint8_t in 0..255 */
    PXI_RGBA16 = 1, /* uint16_t in 0..65535, in the order of the machine */
    PXI_RGBAF = 2   /* float in 0..1 */
} pxi_format;

typedef struct pxi_request {
    uint32_t size;
    uint32_t format;             /* pxi_format */
    uint32_t x, y;               /* region of the canvas, in its pixels */
    uint32_t region_width, region_height; /* 0: the whole canvas; then x and y are 0, too */
    uint32_t width, height;      /* of the output; 0: keeps the aspect; both 0: those of the region */
    double scale;                /* instead of these: output pixels per canvas pixel; 0: not used */
    uint32_t moving;             /* 1: the picture at `time` */
    uint32_t without_background; /* 1: without the back layer of an opaque picture */
    double time;                 /* seconds */
    const uint32_t *layers;      /* numbers of the layers to draw; null: all that are not hidden */
    size_t layer_count;
    uint32_t threads;            /* that draw at once; 0 and 1: the caller's alone */
    uint32_t limit_count;
    const pxi_limit *limits;     /* instead of those that the file was opened with */
    pxi_progress progress;
    void *progress_context;
} pxi_request;
#define PXI_REQUEST_INIT \
    {sizeof(pxi_request), 0, 0, 0, 0, 0, 0, 0, 0.0, 0, 0, 0.0, NULL, 0, 0, 0, NULL, NULL, NULL}

typedef struct pxi_output {
    uint32_t size;
    uint32_t width, height;
    uint32_t opaque;  /* 1 if all alphas are 1: of what a decoder puts out without alpha */
    size_t row_bytes; /* least bytes of a row */
    size_t bytes;     /* least bytes of a buffer whose rows follow each other */
} pxi_output;
#define PXI_OUTPUT_INIT {sizeof(pxi_output), 0, 0, 0, 0, 0}

/* Checks a request, and tells what it makes. `request` may be null: the canvas at its own size. */
PXI_API pxi_status pxi_measure(const pxi_file *file, const pxi_request *request, pxi_output *output,
                               pxi_error *error);

/*
 * Draws a picture into a buffer of `bytes` bytes, whose rows begin `stride` bytes apart; 0 is
 * `row_bytes` of `pxi_measure`. After a failure the buffer may hold part of it.
 *
 * What was decoded is kept for the next picture of the same file.
 */
PXI_API pxi_status pxi_render(pxi_file *file, const pxi_request *request, void *pixels, size_t bytes, size_t stride,
                              pxi_error *error);

/*
 * For tests of decoders: all latents of planes, the integers that every decoder must have alike, in the order of
 * PYR-29. `plane` is the number of a PLAN of the file, from 0; PXI_USAGE if there is none. `*count` tells how many
 * numbers fit into `values`, which may be null, and becomes how many there are.
 */
PXI_API pxi_status pxi_latents(pxi_file *file, uint32_t plane, int32_t *values, size_t *count, pxi_error *error);

#ifdef __cplusplus
}
#endif

#endif
