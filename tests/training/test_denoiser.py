"""Training of the denoiser of emoji and of its judge, on a few drawn ones."""

import itertools
import subprocess
import sys

import numpy as np
import pytest
import torch
from PIL import Image

from proxyimg_codec.generate.denoiser import Shape, load
from tests.support.paths import ROOT
from training import denoiser, emoji, emoji_classifier
from training.emoji_groups import CLASSES, RANGES, group_of

POINTS = {"1f600": "faces", "1f435": "animals", "1f1e9-1f1ea": "flags", "1f345": "food"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Emoji of one colour each, and a file that is none."""
    path = tmp_path_factory.mktemp("emoji")
    for k, points in enumerate(POINTS):
        pixels = np.zeros((30, 40, 4), np.uint8)
        pixels[5:25, 10:30] = (60 * k, 200 - 50 * k, 120, 255)
        for number in range(2):
            Image.fromarray(pixels).save(path / f"drawn{number}_{points}.png")
    Image.fromarray(pixels).save(path / "notes_zz.png")
    return path


@pytest.mark.parametrize(
    ("point", "group"),
    [(0x1F600, "faces"), (0x1F44D, "people"), (0x1F436, "animals"), (0x1F34E, "food"),
     (0x1F697, "travel"), (0x26BD, "activities"), (0x1F4A1, "objects"), (0x267B, "symbols"),
     (0x1F3F4, "flags"), (0x1F1EB, "flags"), (0x23, "symbols"), (0x1FFFF, None)],
)  # fmt: skip
def test_groups_are_those_of_unicode(point, group):
    assert group_of(point) == group


def test_ranges_do_not_overlap():
    ranges = sorted(
        (int(a, 16), int(b or a, 16))
        for text in RANGES.values()
        for a, _, b in (part.partition("-") for part in text.split())
    )
    assert all(end < start for (_, end), (start, _) in itertools.pairwise(ranges))


def test_folders_are_read_by_code_points(folder):
    found = emoji.read([folder])
    by_name = [group for _, group in sorted(POINTS.items())]
    assert [CLASSES[k] for k in found.labels] == 2 * by_name
    assert found.pictures.shape == (8, 4, emoji.SIDE, emoji.SIDE)
    # Cut to what shows, which is square.
    assert float(found.pictures[:, 3].min()) > 0.99
    one, two = found.part(0), found.part(1)
    assert len(one.labels) + len(two.labels) == 8
    with pytest.raises(ValueError, match="no emoji"):
        emoji.read([ROOT / "docs/images"])


def test_samples_are_even_and_repeatable(folder):
    found = emoji.read([folder])
    one = emoji.samples(found, 400, 16, torch.Generator().manual_seed(3))
    two = emoji.samples(found, 400, 16, torch.Generator().manual_seed(3))
    torch.testing.assert_close(one[0], two[0], rtol=0, atol=0)
    assert one[0].shape == (400, 3, 16, 16)
    assert 0 <= float(one[0].min()) <= float(one[0].max()) <= 1
    counts = torch.bincount(one[1], minlength=len(CLASSES))
    assert set(torch.nonzero(counts)[:, 0].tolist()) == {CLASSES.index(v) for v in POINTS.values()}
    assert counts[counts > 0].min() > 60


def test_the_loss_falls(folder, monkeypatch):
    """With the whole command line, and in a process of its own."""
    out = folder.parent / "denoiser.pt"
    words = [sys.executable, "-m", "training.denoiser", str(folder), "--out", str(out)]
    subprocess.run([*words, "--steps", "2", "--device", "cpu"], cwd=ROOT, check=True, timeout=120)
    assert out.stat().st_size < 5_000_000
    found = emoji.read([folder])
    random = torch.Generator().manual_seed(5)
    pictures, labels = emoji.samples(found, 32, denoiser.SIDE, random)

    def loss(model):
        with torch.no_grad():
            return float(denoiser.loss(model, pictures, labels, torch.Generator().manual_seed(1)))

    started = load(out)
    assert started.shape == Shape(denoiser.SIDE, denoiser.WIDTHS, CLASSES)
    monkeypatch.setattr(denoiser, "WIDTHS", (8, 16))
    monkeypatch.setattr(denoiser, "BATCH", 8)
    one, two = (loss(denoiser.train(found, steps, 1, "cpu")) for steps in (1, 60))
    assert two < 0.9 * one


def test_the_judge_learns_too(folder, tmp_path, monkeypatch):
    found = emoji.read([folder])
    monkeypatch.setattr(emoji_classifier, "BATCH", 16)
    model = emoji_classifier.train(found, 40, 0)
    assert emoji_classifier.accuracy(model, found, 1) > 0.6
    torch.save(model.state_dict(), tmp_path / "judge.pt")
    again = emoji_classifier.load(tmp_path / "judge.pt")
    assert emoji_classifier.accuracy(again, found, 1) == emoji_classifier.accuracy(model, found, 1)
