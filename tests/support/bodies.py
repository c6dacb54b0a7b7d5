"""Bodies that tests move."""

import numpy as np

from proxyimg_codec.animate.simulate import Body


def sheet(name="sheet", width=120.0, height=90.0, pitch=12.0, at=(20.0, 30.0), seed=0):
    """A jittered lattice of triangles that fills a rectangle."""
    across, down = int(width / pitch), int(height / pitch)
    y, x = np.mgrid[: down + 1, : across + 1]
    nodes = np.stack([x.ravel() * width / across, y.ravel() * height / down], axis=1)
    jitter = np.random.default_rng(seed).uniform(-0.2, 0.2, nodes.shape) * pitch
    edge = (nodes == 0).any(1) | (nodes[:, 0] == width) | (nodes[:, 1] == height)
    nodes[~edge] += jitter[~edge]
    a = (y * (across + 1) + x)[:-1, :-1].ravel()
    b, c, d = a + 1, a + across + 1, a + across + 2
    faces = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, c], 1)])
    return Body(name, nodes + at, faces.astype(np.int32))


def box(body):
    """x0, y0, x1, y1 of a body."""
    return (*body.nodes.min(0).tolist(), *body.nodes.max(0).tolist())


def areas(points, faces):
    """Signed areas of triangles."""
    a, b, c = points[..., faces[:, 0], :], points[..., faces[:, 1], :], points[..., faces[:, 2], :]
    u, v = b - a, c - a
    return (u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) / 2
