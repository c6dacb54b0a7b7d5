"""Pictures made and changed field by field, as no user can."""

from dataclasses import replace

from proxyimg_codec.api import Image, Layer
from proxyimg_codec.model import Layers, Picture
from proxyimg_codec.render.neighbours import settled


def image(*args, **fields):
    """An image of the fields of a `Picture`, whose layers may be handles."""
    return Image(Picture(*args[:5], _data(args[5]), *args[6:], **fields))


def changed(whole, **fields):
    """An image, a layer, or any other dataclass with other fields."""
    if isinstance(whole, Image):
        if "layers" in fields:
            fields["layers"] = Layers(settled(list(_data(fields["layers"]))))
        return Image(replace(whole.picture, **fields), whole.cache)
    return replace(whole.data if isinstance(whole, Layer) else whole, **fields)


def posed(image, **poses):
    """An image whose layers have other values in their poses, by name."""
    layers = [
        changed(v, pose=changed(v.pose, **poses.get(v.name, {})), name=v.name) for v in image.layers
    ]
    return changed(image, layers=Layers(layers))


def _data(layers):
    return Layers(v.data if isinstance(v, Layer) else v for v in layers)
