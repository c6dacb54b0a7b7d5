"""Mask folders: what is written is read again; what somebody else put there is left alone."""

import numpy as np
import pytest
from PIL import Image

from proxyimg_codec.encoder.shapes.mask_files import load_masks
from proxyimg_codec.encoder.shapes.mask_folder import write_masks
from proxyimg_codec.encoder.shapes.masks import Region
from proxyimg_codec.errors import InputError

H, W = 13, 17


def regions(*names):
    masks = np.arange(H * W).reshape(H, W) % len(names)
    return [Region(name, masks == k) for k, name in enumerate(names)]


@pytest.mark.parametrize(
    "names",
    [
        ["back", "cat"],
        ["rest", "2 cats", "10", "1.5 kg", "Größe é", "猫", "a=b", "a.png", "cat 2", "x" * 200],
        [f"object {k}" for k in range(12)],
        ["only"],
        ["back", "cat", "cat/eye", "cat/eye/pupil", "cat/ear.s", "dog"],
        ["back", "herd/cow", "herd/calf", "tree"],
    ],
)
def test_the_same_layers_are_read_in_the_same_order(tmp_path, names):
    written = regions(*names)
    files = write_masks(tmp_path / "masks", written)
    assert sorted(tmp_path.rglob("*.png")) == sorted(files)
    read = load_masks(tmp_path / "masks", W, H)
    assert [r.name for r in read] == names
    for one, two in zip(written, read, strict=True):
        assert (one.mask == two.mask).all()


@pytest.mark.parametrize("name", ["cat/..", "cat/", "..", " cat", "-x", "_a", "a\\b", "猫" * 100])
def test_names_that_no_file_can_have_are_refused(tmp_path, name):
    with pytest.raises(InputError, match=r"masks: .*(name|cannot be written)"):
        write_masks(tmp_path / "masks", regions("back", name))
    assert list(tmp_path.iterdir()) == []


def test_masks_of_an_earlier_run_are_replaced_when_asked(tmp_path):
    write_masks(tmp_path, regions("back", "a", "b"))
    (tmp_path / "notes.txt").write_text("kept")
    with pytest.raises(InputError, match="--force"):
        write_masks(tmp_path, regions("back", "c"))
    write_masks(tmp_path, regions("back", "c"), replace=True)
    names = sorted(f.name for f in tmp_path.iterdir())
    assert names == ["0 back.png", "1 c.png", "notes.txt"]


def test_folders_of_parts_are_replaced_too(tmp_path):
    write_masks(tmp_path, regions("back", "cat", "cat/eye", "dog/ear"))
    (tmp_path / "3 dog" / "notes.txt").write_text("kept")
    write_masks(tmp_path, regions("back", "cat"), replace=True)
    assert [r.name for r in load_masks(tmp_path, W, H)] == ["back", "cat"]
    assert sorted(f.name for f in tmp_path.iterdir()) == ["0 back.png", "1 cat.png", "3 dog"]


@pytest.mark.parametrize("name", ["photo.jpg", "1 cat.png", "cat.webp", "1 cat/eye.png"])
def test_pictures_of_others_are_never_replaced(tmp_path, name):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    Image.new("RGB", (W, H), "red").save(tmp_path / name)
    before = (tmp_path / name).read_bytes()
    with pytest.raises(InputError, match=name):
        write_masks(tmp_path, regions("back", "cat"), replace=True)
    assert [f.relative_to(tmp_path).as_posix() for f in tmp_path.rglob("*.*")] == [name]
    assert (tmp_path / name).read_bytes() == before


def test_a_folder_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").write_text("x")
    for place in (tmp_path / "file", tmp_path / "none" / "masks"):
        with pytest.raises(InputError, match=str(place)):
            write_masks(place, regions("back"))
