"""Training of the layers network: samples with known answers, losses, and an export that agrees."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from training.layers import loss  # noqa: E402
from training.layers_data import Shot, held_out, sources  # noqa: E402
from training.layers_export import exported  # noqa: E402
from training.layers_network import LayersNetwork  # noqa: E402
from training.layers_samples import Sampler  # noqa: E402

SIZE = 96


def sampler(seed=3):
    """Grey pictures without figures, and a red disc as the only sprite."""
    rows, columns = np.indices((61, 61))
    disc = (rows - 30) ** 2 + (columns - 30) ** 2 <= 30**2
    sprite = np.dstack([disc * 255, disc * 0, disc * 0, disc * 255]).astype(np.uint8)
    plain = Shot(np.full((80, 130, 3), 128, np.uint8), np.zeros((80, 130), np.uint8))
    kinds = {kind: [plain] for kind in ("bsds", "coco", "photo")}
    return Sampler(kinds, ((1.0, [sprite]),), seed)


def test_samples_depend_on_seed_and_number_alone():
    one, again, other = (
        sampler().sample(5, SIZE),
        sampler().sample(5, SIZE),
        sampler(4).sample(5, SIZE),
    )
    for name in ("rgb", "figure", "edge", "owner", "known"):
        np.testing.assert_array_equal(getattr(one, name), getattr(again, name))
    assert (one.rgb != other.rgb).any()


def test_sprites_are_figures_with_edges_that_they_own():
    found = [s for s in (sampler().sample(k, SIZE) for k in range(40)) if s.figure.mean() > 0.1]
    assert len(found) > 8
    for s in found:
        assert s.rgb.shape == (SIZE, SIZE, 3)
        assert set(np.unique(s.figure)) <= {0, 1}
        rim = s.known > 0
        np.testing.assert_allclose(np.linalg.norm(s.owner[rim], axis=1), 1, atol=1e-4)
        # A step along the vector from the outer part of the rim leads into the figure.
        y, x = np.nonzero(rim & (s.figure == 0))
        step = 7 * s.owner[y, x]
        to = np.clip(np.rint(np.stack([y, x], 1) + step[:, ::-1]).astype(int), 0, SIZE - 1)
        assert s.figure[to[:, 0], to[:, 1]].mean() > 0.9
        deep = (s.edge == 0) & (s.figure == 1)
        assert deep.any()
        assert (s.edge[rim & (s.figure == 1)] == 1).any()


def test_the_loss_is_least_for_the_truth():
    figure = torch.zeros(1, 32, 32)
    figure[:, 8:24, 8:24] = 1
    edge = torch.full((1, 32, 32), -1.0)
    edge[:, :, :16] = 0
    edge[:, :, 8] = 1
    owner, known = torch.zeros(1, 2, 32, 32), torch.zeros(1, 32, 32)
    owner[:, 0], known[:, :, 8] = 1, 1
    truth = torch.stack(
        [12 * figure - 6, 12 * (edge > 0.5).float() - 6, owner[:, 0], owner[:, 1]], 1
    )
    best = loss(truth, figure, edge, owner, known)
    for channel in range(3):
        worse = truth.clone()
        worse[:, channel] *= -1
        assert loss(worse, figure, edge, owner, known)[channel] > best[channel] + 0.1
    # Edges that nobody knows do not count.
    free = truth.clone()
    free[:, 1, :, 16:] = 9
    assert loss(free, figure, edge, owner, known)[1] == best[1]


def test_the_export_agrees_with_the_network():
    onnxruntime = pytest.importorskip("onnxruntime")
    torch.manual_seed(0)
    model = LayersNetwork()
    for _ in range(3):  # statistics of the normalisations
        model(torch.rand(2, 3, 64, 96))
    model.eval()
    rgb = np.random.default_rng(0).random((1, 3, 96, 160), np.float32)
    session = onnxruntime.InferenceSession(exported(model).SerializeToString())
    maps = session.run(None, {"rgb": rgb})[0]
    with torch.no_grad():
        wanted = model(torch.from_numpy(rgb)).numpy()
    wanted[:, :2] = 1 / (1 + np.exp(-wanted[:, :2]))
    assert maps.shape == (1, 4, 96, 160)
    # 7-bit weights differ a little; a wrong layer differs by the spread of the maps.
    assert np.abs(maps - wanted).mean() < 0.1 * wanted.std()


def test_pictures_kept_apart_are_no_sources(data_dir):
    names = {path.name for _, path in sources(data_dir)}
    bsds, coco = (sorted((data_dir / "layers" / k).glob("*.jpg")) for k in ("bsds", "coco"))
    assert not names & {p.name for p in (*bsds[::5], *coco[1::2])}
    assert held_out("bsds", 5)
    assert not held_out("photo", 5)
