/* Loader of gdk-pixbuf for .pxi files: GNOME's and other desktops' programs show them, and thumbnails. */
#define GDK_PIXBUF_ENABLE_BACKEND
#include <gdk-pixbuf/gdk-pixbuf-io.h>
#include <gmodule.h>

#include "pxi.h"

typedef struct {
    GdkPixbufModuleSizeFunc sized;
    GdkPixbufModulePreparedFunc prepared;
    GdkPixbufModuleUpdatedFunc updated;
    gpointer user;
    GByteArray *bytes;
} Loader;

static gboolean refused(const pxi_error *from, GError **error) {
    const int code = from->status == PXI_MEMORY ? GDK_PIXBUF_ERROR_INSUFFICIENT_MEMORY
                     : from->status == PXI_UNSUPPORTED ? GDK_PIXBUF_ERROR_UNKNOWN_TYPE
                                                       : GDK_PIXBUF_ERROR_CORRUPT_IMAGE;
    g_set_error_literal(error, GDK_PIXBUF_ERROR, code, from->message);
    return FALSE;
}

static gpointer begin(GdkPixbufModuleSizeFunc sized, GdkPixbufModulePreparedFunc prepared,
                      GdkPixbufModuleUpdatedFunc updated, gpointer user, GError **error) {
    Loader *loader = g_new0(Loader, 1);
    (void)error;
    *loader = (Loader){sized, prepared, updated, user, g_byte_array_new()};
    return loader;
}

static gboolean more(gpointer context, const guchar *bytes, guint count, GError **error) {
    (void)error;
    g_byte_array_append(((Loader *)context)->bytes, bytes, count);
    return TRUE;
}

/* The picture in the size that the program wants. */
static GdkPixbuf *drawn(pxi_file *file, Loader *loader, pxi_error *error) {
    pxi_request request = PXI_REQUEST_INIT;
    pxi_output output = PXI_OUTPUT_INIT;
    GdkPixbuf *picture;
    gint width, height;
    if (pxi_measure(file, NULL, &output, error)) return NULL;
    width = (gint)output.width, height = (gint)output.height;
    if (loader->sized) loader->sized(&width, &height, loader->user);
    if (width < 1 || height < 1) return NULL;  /* only the size was asked for */
    request.width = (uint32_t)width, request.height = (uint32_t)height;
    if (pxi_measure(file, &request, &output, error)) return NULL;
    if (!(picture = gdk_pixbuf_new(GDK_COLORSPACE_RGB, TRUE, 8, width, height))) {
        error->status = PXI_MEMORY;
        return NULL;
    }
    if (pxi_render(file, &request, gdk_pixbuf_get_pixels(picture), gdk_pixbuf_get_byte_length(picture),
                   (size_t)gdk_pixbuf_get_rowstride(picture), error))
        g_clear_object(&picture);
    return picture;
}

static gboolean stop(gpointer context, GError **gerror) {
    Loader *loader = context;
    pxi_error error = PXI_ERROR_INIT;
    pxi_file *file = NULL;
    GdkPixbuf *picture = NULL;
    if (!pxi_open(loader->bytes->data, loader->bytes->len, NULL, &file, &error)) picture = drawn(file, loader, &error);
    if (picture) {
        loader->prepared(picture, NULL, loader->user);
        loader->updated(picture, 0, 0, gdk_pixbuf_get_width(picture), gdk_pixbuf_get_height(picture), loader->user);
        g_object_unref(picture);
    }
    pxi_close(file);
    g_byte_array_unref(loader->bytes);
    g_free(loader);
    return error.status ? refused(&error, gerror) : TRUE;
}

G_MODULE_EXPORT void fill_vtable(GdkPixbufModule *module) {
    module->begin_load = begin;
    module->load_increment = more;
    module->stop_load = stop;
}

G_MODULE_EXPORT void fill_info(GdkPixbufFormat *info) {
    static GdkPixbufModulePattern signature[] = {{"\x89PXI\r\n\x1a\n", "        ", 100}, {NULL, NULL, 0}};
    static gchar *types[] = {"image/vnd.pxi", NULL}, *suffixes[] = {"pxi", NULL};
    info->name = "pxi";
    info->signature = signature;
    info->description = "ProxyImg picture";
    info->mime_types = types;
    info->extensions = suffixes;
    info->flags = GDK_PIXBUF_FORMAT_THREADSAFE;
    info->license = "MIT";
}
