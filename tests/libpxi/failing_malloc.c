/* Memory that ends: the allocation of the number FAIL_AT, and all later ones, fail. For LD_PRELOAD. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdlib.h>

static long left = -1;

__attribute__((constructor)) static void begin(void) {
    const char *at = getenv("FAIL_AT");
    if (at) left = atol(at);
}

static int fails(void) {
    if (left > 0) left--;
    return left == 0;
}

void *malloc(size_t size) {
    static void *(*own)(size_t);
    if (!own) *(void **)&own = dlsym(RTLD_NEXT, "malloc");
    if (!fails()) return own(size);
    errno = ENOMEM;
    return NULL;
}
