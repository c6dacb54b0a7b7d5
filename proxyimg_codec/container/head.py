"""HEAD: the canvas, and the number of layers and networks that follow. Always the first chunk."""

from .fields import Field

TYPE = "HEAD"

FIELDS = (
    Field("size", "ints", "Canvas width and height in pixels.", 1, 1 << 24, items=2),
    Field("channels", "int", "3 = colour; 4 = textures also give alpha.", 3, 4),
    Field("opaque", "int", "1 = layer 0 covers the whole canvas and gives no alpha.", 0, 1),
    Field("depth", "int", "Bits a sample of the original: a hint for output, 8 or 16.", 8, 16),
    Field("layers", "int", "Number of LAYR and of TEXR chunks.", 1, 1 << 16),
    Field("networks", "int", "Number of NETW chunks.", 0, 1 << 16),
)
