"""NETW: one quantized decoder network. Networks are numbered in file order from 0."""

from .fields import Field

TYPE = "NETW"

FIELDS = (
    Field("dim", "int", "Features a point, D.", 1, 64),
    Field("octaves", "int", "Octaves of the frequency encoding, L.", 0, 12),
    Field("hidden", "int", "Width of the hidden layers.", 1, 1024),
    Field("depth", "int", "Number of hidden layers.", 1, 8),
    Field("channels", "int", "Outputs: 3 or 4, at most as in HEAD.", 3, 4),
    Field("bits", "int", "Bits a weight.", 2, 8),
    Field("steps", "bin", "Quantization step of each output row, all layers, float16."),
    Field("biases", "bin", "Bias of each output row, all layers, float16."),
    Field("weights", "bin", "One coded array [1, out, in] a layer, each after its u32 length."),
)
