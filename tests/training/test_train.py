"""Training learns, and resumes where it was stopped."""

import sys

import cv2
import numpy as np
import pytest
import torch

from proxyimg_codec.encoder.pyramid.model import Model
from training import export, pictures, train


@pytest.fixture
def folder(tmp_path):
    y, x = np.mgrid[:80, :90]
    picture = np.stack([2 * x, 3 * y, 128 + 40 * np.sin(x / 5)], 2).clip(0, 255).astype(np.uint8)
    (tmp_path / "pictures").mkdir()
    for name in "ab":
        cv2.imwrite(str(tmp_path / "pictures" / f"{name}.png"), picture)
    return tmp_path / "pictures"


def run(monkeypatch, folder, out, phase, steps, *more):
    monkeypatch.setattr(pictures, "SIZE", 64)
    words = ["train", str(folder), "--out", str(out), "--phase", str(phase), "--steps", str(steps)]
    monkeypatch.setattr(sys, "argv", [*words, "--threads", "1", "--batch", "1", *more])
    train.main()
    return torch.load(out)


@pytest.mark.parametrize("kind", ["1", "2", "2 --wider"])
def test_a_resumed_run_is_an_unbroken_one(monkeypatch, folder, tmp_path, kind, capsys):
    phase, more = int(kind[0]), kind.split()[1:]
    monkeypatch.setattr(train, "KEPT_APART", 2)
    # Phase 2 is resumed between batches: after a multiple of the steps of one.
    half = 3 if phase == 1 else train.ROUNDS - 1
    # The cosine depends on the planned length: hold it still.
    monkeypatch.setattr(train.Journal, "set_rates", lambda self: None)
    run(monkeypatch, folder, tmp_path / "parts.pt", phase, half, *more)
    parts = run(monkeypatch, folder, tmp_path / "parts.pt", phase, 2 * half, *more)
    whole = run(monkeypatch, folder, tmp_path / "whole.pt", phase, 2 * half, *more)
    assert parts["done"] == whole["done"] == 2 * half
    for kind in ("model", "average"):
        for name, value in whole[kind].items():
            assert torch.equal(value, parts[kind][name]), name
    assert "J" in capsys.readouterr().out


def test_export_is_what_the_decoder_reads(monkeypatch, folder, tmp_path):
    from proxyimg_codec.texture import registered_model

    run(monkeypatch, folder, tmp_path / "state.pt", 1, 2)
    monkeypatch.setattr(sys, "argv", ["export", str(tmp_path / "state.pt"), str(tmp_path)])
    export.main()
    data = (tmp_path / "pyramid-1.bin").read_bytes()
    found = registered_model.unpack(data)
    trained = torch.load(tmp_path / "state.pt")["average"]
    first = trained["levels.0.first.weight"].numpy()
    assert np.abs(found.context[0].first.floats - first).max() <= 2.0 ** (
        found.context[0].first.exponent - 1
    )
    assert np.abs(found.to_colour.floats - trained["to_colour"].numpy()).max() < 1e-4


def test_a_new_model_has_drawn_weights_and_changes_nothing_yet():
    torch.manual_seed(1)
    model = train.drawn(Model())
    found = [(n, p) for n, p in model.named_parameters() if n.endswith("weight")]
    zero = {n for n, p in found if not p.any()}
    assert zero == {n for n, _ in found if ".third." in n}
    assert all(level.causal.std().item() == pytest.approx(0.02, rel=0.1) for level in model.levels)
    torch.manual_seed(2)
    other = train.drawn(Model())
    assert not torch.equal(model.level(1).mix.weight, other.level(1).mix.weight)
