"""Pictures with an object whose pattern is known, to look for what is left of it."""

import numpy as np

import proxyimg_codec as pxi

ROWS, COLUMNS = 117, 139
OBJECT = np.hypot(*(np.mgrid[:ROWS, :COLUMNS] - np.array([55, 70])[:, None, None])) < 33
"""bool [117, 139], True within the object."""

COLOURS = {"red": [(230, 40, 30), (120, 10, 60)], "blue": [(20, 60, 90), (40, 200, 240)]}


def pixels(colour):
    """uint8 [117, 139, 3]: a chequered disc on a ground with noise that is always the same."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    waves = np.stack([120 + 60 * np.sin(x / 19), 110 + 50 * np.cos((x + y) / 23), 90 + y], -1)
    ground = waves + np.random.default_rng(5).normal(0, 5, waves.shape)
    pattern = np.array(COLOURS[colour])[(x // 5 + y // 5) % 2]
    return np.clip(np.where(OBJECT[..., None], pattern, ground), 0, 255).astype(np.uint8)


def encoded(colour, quality=70):
    """The picture with the disc as a layer called `disc`."""
    return pxi.encode(pixels(colour), masks={"disc": OBJECT}, effort=1, quality=quality)
