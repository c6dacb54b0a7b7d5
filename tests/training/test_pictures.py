"""Nothing that the codec is judged by may enter training."""

import cv2
import numpy as np
import pytest

from proxyimg_codec.errors import InputError
from training import pictures


def test_every_test_picture_is_listed(data_dir):
    listed = set(pictures.TEST_PICTURES.read_text().split())
    folders = ("kodak", "photo2k", "photo", "clipart", "anime", "depth")
    for folder in folders:
        for path in sorted((data_dir / folder).iterdir()):
            picture = pictures.read(path)
            assert picture is None or pictures.digest(picture) in listed, path.name


def test_no_training_picture_is_a_test_picture(data_dir):
    listed = set(pictures.TEST_PICTURES.read_text().split())
    for path in sorted((data_dir / "train").iterdir())[::8]:  # each eighth, for time
        picture = pictures.read(path)
        assert picture is None or pictures.digest(picture) not in listed, path.name


def test_training_refuses_a_test_picture(tmp_path, monkeypatch):
    rng = np.random.default_rng(0)
    picture = rng.integers(0, 256, (300, 280, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), picture[..., ::-1])
    assert len(pictures.load(tmp_path)) == 1
    listing = tmp_path / "listing.txt"
    listing.write_text(pictures.digest(picture) + "\n")
    monkeypatch.setattr(pictures, "TEST_PICTURES", listing)
    with pytest.raises(InputError, match="test picture"):
        pictures.load(tmp_path)


def test_crops_are_seeded():
    rng = np.random.default_rng(0)
    whole = [rng.integers(0, 256, (400, 500, 3)).astype(np.uint8)]
    first, second = (
        [pictures.crop(whole, np.random.default_rng(k)) for k in range(12)] for _ in range(2)
    )
    assert all((a == b).all() for a, b in zip(first, second, strict=True))
    assert {c.shape for c in first} == {(pictures.SIZE, pictures.SIZE, 3)}
