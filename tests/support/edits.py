"""Edits, right and wrong, and where in the picture they act."""

import numpy as np

from proxyimg_codec.geometry import coverage as cover
from proxyimg_codec.render.compose import outline
from proxyimg_codec.render.view import make_view


def covered(image, name):
    """bool [H, W] where a layer has any coverage now."""
    view = make_view((image.width, image.height))
    paths = outline(image.layers[name].outline, view)
    return cover.coverage(paths, 0, 0, image.width, image.height) > 0


def grown(mask, radius=2):
    out = mask.copy()
    for _ in range(radius):
        p = np.pad(out, 1)
        out = p[1:-1, 1:-1] | p[:-2, 1:-1] | p[2:, 1:-1] | p[1:-1, :-2] | p[1:-1, 2:]
        p = np.pad(out, 1)
        out |= p[:-2, :-2] | p[2:, 2:] | p[:-2, 2:] | p[2:, :-2]
    return out


EDITS = {
    "move": lambda v: v.moved(5, -3.25),
    "rotate": lambda v: v.rotated(25),
    "scale": lambda v: v.scaled(1.3, 0.8),
    "shear": lambda v: v.sheared(0.3),
    "affine": lambda v: v.transformed([0.9, 0.1, -0.2, 1.1, 3, 1]),
    "flip": lambda v: v.flipped(),
    "drag": lambda v: v.dragged({(32, 14): (6, -2), (32, 34): (0, 0)}),
    "point": lambda v: v.with_point(0, 0, 3, -2),
    "point that takes the inside along": lambda v: v.with_point(0, 0, 3, -2, follow=True),
    "remove": lambda v: v.removed(),
    "duplicate": lambda v: v.duplicated(),
    "order": lambda v: v.reordered("back"),
    "hide": lambda v: v.hidden(),
    "opacity": lambda v: v.with_opacity(0.4),
    "recolour": lambda v: v.recoloured(hue=90, saturation=0.5, brightness=0.9, tint="#30a0ff"),
    "texture": lambda v: v.textured("bar"),
    "texture by shape": lambda v: v.textured("bar", fit="shape"),
    "rename": lambda v: v.renamed("sun"),
}


BAD = [
    ({"op": "explode", "layer": "disc"}, "explode"),
    ({"layer": "disc"}, "unknown"),
    ("move", "unknown"),
    ({"op": "move", "layer": "cat", "by": [1, 1]}, "no layer 'cat'"),
    ({"op": "move", "layer": 9, "by": [1, 1]}, "no layer 9"),
    ({"op": "move", "layer": "disc"}, "by is missing"),
    ({"op": "move", "layer": "disc", "by": [1]}, "dx, dy"),
    ({"op": "move", "layer": "disc", "by": [1, float("nan")]}, "dx, dy"),
    ({"op": "move", "layer": "disc", "by": [1, True]}, "dx, dy"),
    ({"op": "move", "layer": "disc", "by": [1, 1], "speed": 3}, "speed"),
    ({"op": "move", "layer": "disc", "by": [1e12, 0]}, "range"),
    ({"op": "scale", "layer": "disc", "by": [0, 1]}, "singular"),
    ({"op": "scale", "layer": "disc", "by": [1000, 1]}, "127 times"),
    ({"op": "affine", "layer": "disc", "matrix": [1, 2, 2, 4, 0, 0]}, "singular"),
    ({"op": "flip", "layer": "disc", "axis": "diagonal"}, "horizontal"),
    ({"op": "drag", "layer": "disc", "handles": []}, "handles"),
    ({"op": "drag", "layer": "disc", "handles": [[1, 2, 1e9, 0]]}, "range"),
    ({"op": "point", "layer": "back", "path": 0, "point": 0, "by": [1, 1]}, "no boundary"),
    ({"op": "point", "layer": "disc", "path": 3, "point": 0, "by": [1, 1]}, "paths 0..0"),
    ({"op": "point", "layer": "disc", "path": 0, "point": 999, "by": [1, 1]}, "control points"),
    ({"op": "point", "layer": "disc", "path": 0, "point": 0, "by": [1e9, 1]}, "range"),
    ({"op": "point", "layer": "disc", "path": 0, "point": 0, "by": [1, 1], "follow": 1}, "follow"),
    ({"op": "point", "layer": "disc", "path": 0, "point": 0, "by": [1e9, 1], "follow": True},
     "point: layer 'disc' would leave"),
    ({"op": "opacity", "layer": "disc", "value": 1.5}, "within"),
    ({"op": "recolour", "layer": "disc", "tint": "red"}, "#rrggbb"),
    ({"op": "recolour", "layer": "disc", "brightness": 1000}, "256 times"),
    ({"op": "cut", "layer": "disc"}, "either a mask"),
    ({"op": "cut", "layer": "disc", "points": []}, "points"),
    ({"op": "cut", "layer": "disc", "mask": "m.png", "outside": [[1, 2]]}, "either a mask"),
    ({"op": "complete", "layer": "back"}, "implicit texture"),
    ({"op": "complete", "layer": "back", "method": "magic"}, "exemplar"),
    ({"op": "merge", "layer": "disc", "other": "disc"}, "twice"),
    ({"op": "merge", "layer": "disc", "other": "bar"}, "textures of their own"),
    ({"op": "animate", "motion": {"version": 1}}, "neither 'layers' nor 'preset'"),
    ({"op": "animate", "motion": {"version": 1, "preset": "tremble"}}, "preset"),
    ({"op": "animate", "motion": {"version": 1, "layers": {"cat": {}}}}, "cat"),
    ({"op": "animate", "motion": "sway"}, "it must be a motion"),
    ({"op": "insert", "source": "nothing.png"}, "no file"),
    ({"op": "insert", "source": "nothing.png", "over": "cat"}, "no layer 'cat'"),
    ({"op": "rename", "layer": "disc", "name": "bar"}, "already"),
    ({"op": "rename", "layer": "disc", "name": ""}, "1..200"),
    ({"op": "rename", "layer": "disc", "name": "a\nb"}, "printable"),
    ({"op": "duplicate", "layer": "disc", "name": "back"}, "already"),
    ({"op": "order", "layer": "disc", "to": "middle"}, "middle"),
    ({"op": "order", "layer": "disc", "to": 3}, "0..2"),
    ({"op": "group", "layers": ["disc"], "name": "bar"}, "already"),
    ({"op": "group", "layers": ["cat"], "name": "g"}, "cat"),
    ({"op": "ungroup", "name": "g"}, "no group"),
    ({"op": "parent", "layer": "disc", "to": "disc"}, "part of itself"),
    ({"op": "parent", "layer": "disc", "to": "cat"}, "no layer or group"),
    ({"op": "texture", "layer": "disc", "source": "nothing.png"}, "neither a layer"),
    ({"op": "texture", "layer": "disc", "source": "bar", "from_layer": "x"}, "pxi"),
    ({"op": "texture", "layer": "disc", "source": "bar", "fit": "tight"}, "fit"),
    ({"op": "generate", "layer": "disc", "prompt": "fur"}, "guide is missing"),
    ({"op": "generate", "layer": "disc", "prompt": "fur", "guide": "a", "seed": "x"}, "seed"),
    ({"op": "generate", "layer": "disc", "prompt": "fur", "guide": "a", "steps": 0}, "steps is 0"),
    ({"op": "generate", "layer": "disc", "prompt": "fur", "guide": "a", "times": [0.5, 0.5]},
     "times"),
]  # fmt: skip


def near(samples):
    """Where a sample is set within 2 across and 2 down."""
    height, width = samples.shape
    return np.array(
        [[samples[max(j - 2, 0) : j + 3, max(i - 2, 0) : i + 3].any() for i in range(width)]
         for j in range(height)]
    )  # fmt: skip


FLAGS = [
    (["--move", "disc", "-4,2.5"], {"op": "move", "layer": "disc", "by": [-4.0, 2.5]}),
    (["--rotate", "disc", "30"], {"op": "rotate", "layer": "disc", "degrees": 30.0}),
    (["--rotate", "2", "-30@1,2"],
     {"op": "rotate", "layer": 2, "degrees": -30.0, "pivot": [1.0, 2.0]}),
    (["--scale", "disc", "1.5"], {"op": "scale", "layer": "disc", "by": [1.5, 1.5]}),
    (["--scale", "disc", "1.5,2@0,0"],
     {"op": "scale", "layer": "disc", "by": [1.5, 2.0], "pivot": [0.0, 0.0]}),
    (["--shear", "disc", "0.2,0"], {"op": "shear", "layer": "disc", "by": [0.2, 0.0]}),
    (["--affine", "disc", "1,0,0.1,1,2,3"],
     {"op": "affine", "layer": "disc", "matrix": [1.0, 0.0, 0.1, 1.0, 2.0, 3.0]}),
    (["--flip", "disc", "vertical"], {"op": "flip", "layer": "disc", "axis": "vertical"}),
    (["--drag", "disc", "32,14:-5,1", "32,34:0,0"],
     {"op": "drag", "layer": "disc", "handles": [[32.0, 14.0, -5.0, 1.0], [32.0, 34.0, 0.0, 0.0]]}),
    (["--point", "disc", "0,3", "-2,1"],
     {"op": "point", "layer": "disc", "path": 0, "point": 3, "by": [-2.0, 1.0]}),
    (["--point", "disc", "0,3", "-2,1", "--follow"],
     {"op": "point", "layer": "disc", "path": 0, "point": 3, "by": [-2.0, 1.0], "follow": True}),
    (["--remove", "disc"], {"op": "remove", "layer": "disc"}),
    (["--duplicate", "disc"], {"op": "duplicate", "layer": "disc"}),
    (["--duplicate", "disc=moon"], {"op": "duplicate", "layer": "disc", "name": "moon"}),
    (["--rename", "disc=sun"], {"op": "rename", "layer": "disc", "name": "sun"}),
    (["--order", "disc", "1"], {"op": "order", "layer": "disc", "to": 1}),
    (["--order", "bar", "front"], {"op": "order", "layer": "bar", "to": "front"}),
    (["--hide", "disc"], {"op": "hide", "layer": "disc"}),
    (["--still", "disc"], {"op": "still", "layer": "disc"}),
    (["--opacity", "disc", ".5"], {"op": "opacity", "layer": "disc", "value": 0.5}),
    (["--animate", "sway"], {"op": "animate", "motion": {"version": 1, "preset": "sway"}}),
    (["--animate", '{"preset": "jelly", "duration": 1, "version": 1, "fps": 6}'],
     {"op": "animate", "motion": {"preset": "jelly", "duration": 1, "version": 1, "fps": 6}}),
    (["--texture", "disc=bar"], {"op": "texture", "layer": "disc", "source": "bar"}),
    (["--texture", "disc=bar@shape"],
     {"op": "texture", "layer": "disc", "source": "bar", "fit": "shape"}),
    (["--recolour", "disc", "hue:40,#102030"],
     {"op": "recolour", "layer": "disc", "hue": 40.0, "tint": "#102030"}),
    (["--group", "both=disc,1"], {"op": "group", "layers": ["disc", 1], "name": "both"}),
    (["--parent", "disc=bar"], {"op": "parent", "layer": "disc", "to": "bar"}),
    (["--parent", "2=1"], {"op": "parent", "layer": 2, "to": 1}),
    (["--texture", "-1=1@shape"], {"op": "texture", "layer": -1, "source": 1, "fit": "shape"}),
]  # fmt: skip
