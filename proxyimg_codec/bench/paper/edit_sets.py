"""Sets of edits in the layouts that they are published in, with an edit script for each picture.

HumanEdit (Bai et al. 2024) is a table: Parquet files, or ``metadata.jsonl`` with the same columns
whose pictures are names of files. OIR-Bench (Yang et al. 2024) is YAML files that name pictures and
masks. Neither says how a program of layers makes an edit. So the user adds what ``pxi-edit
--script`` takes, as ``scripts/NAME.json``, and may add ``masks/NAME``, whatever ``pxi-encode
--masks`` takes; pictures without a script are passed over.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from ...edit.script import parse
from ...encoder.shapes.mask_files import load_masks
from ...encoder.shapes.masks import Region
from ...errors import InputError
from .items import Pixels

OBJECT = "object"
"""Name of the layer that the mask of a picture makes, for scripts."""


@dataclass(frozen=True)
class Case:
    """An edit.

    Attributes:
        source: Name of the set.
        name: Name of the picture.
        kind: Type of the edit, as the set calls it.
        before: uint8 [H, W, 3] picture.
        masks: Layers to encode it with.
        changed: bool [H, W], True where the edit may change the picture.
        edits: Operations of an edit script.
        files: Files that the script names, with their content.
        after: uint8 [H, W, 3] true result; None if the set has none.
        prompt: Description of the result.
    """

    source: str
    name: str
    kind: str
    before: Pixels
    masks: tuple[Region, ...]
    changed: NDArray[np.bool_]
    edits: tuple[Mapping[str, Any], ...]
    files: Mapping[str, bytes]
    after: Pixels | None
    prompt: str

    @property
    def digest(self) -> str:
        """Hash of all but the picture before."""
        hasher = hashlib.sha256(json.dumps([self.edits, self.prompt, self.kind]).encode())
        for name, content in self.files.items():
            hasher.update(name.encode() + content)
        for array in (self.changed, self.after, *(r.mask for r in self.masks)):
            hasher.update(b"" if array is None else array.tobytes())
        return hasher.hexdigest()[:16]


def humanedit(folder: Path, source: str = "HumanEdit") -> list[Case]:
    """Cases of a folder in the layout of HumanEdit.

    Raises:
        InputError: A file is missing or damaged, or pyarrow is needed and not installed.
    """
    found = []
    for row in _records(folder):
        name = str(row["IMAGE_ID"])
        scripted = _scripted(folder, Path(name).stem)
        if scripted is None:
            continue
        before, after = (_rgb(folder, row[k]) for k in ("INPUT_IMG", "OUTPUT_IMG"))
        changed = _inside(folder, row["MASK_IMG"])
        if not before.shape[:2] == after.shape[:2] == changed.shape:
            raise InputError(f"{folder}: the pictures of {name} differ in size")
        masks = _masks(folder, name, before) or (Region(OBJECT, changed),)
        prompt = str(row.get("OUTPUT_CAPTION_BY_LLAMA") or row["OUTPUT_DESCRIPTION"])
        kind = str(row["EDITING_TYPE"])
        found.append(Case(source, name, kind, before, masks, changed, *scripted, after, prompt))
    return found


def oir_bench(folder: Path) -> list[Case]:
    """Cases of a folder in the layout of OIR-Bench; there is no true result.

    Layers have the names of the files of their masks.

    Raises:
        InputError: A file is missing or damaged, or pyyaml is not installed.
    """
    try:
        import yaml
    except ModuleNotFoundError:
        raise InputError(f"{folder}: reading OIR-Bench needs pip install pyyaml") from None
    found = []
    for path in sorted(folder.glob("*.y*ml")):
        try:
            entries = yaml.safe_load(path.read_text())
        except (OSError, yaml.YAMLError) as error:
            raise InputError(f"{path}: cannot be read: {error}") from None
        for entry in (entries or {}).values():
            picture = _located(folder, entry["image_path"])
            scripted = _scripted(folder, picture.stem)
            if scripted is None:
                continue
            before = _rgb(picture.parent, picture.name)
            names = entry.get("prompt_change_mask") or [entry["origin_prompt_mask"]]
            files = [_located(folder, name) for name in names]
            masks = tuple(Region(f.stem, _inside(f.parent, f.name)) for f in files)
            changed = np.logical_or.reduce([r.mask for r in masks])
            kind = path.stem.replace("_", " ")
            found.append(Case("OIR-Bench", picture.stem, kind, before, masks, changed, *scripted,
                              None, _prompt(entry)))  # fmt: skip
    return found


def _prompt(entry: Mapping[str, Any]) -> str:
    """Description of the result of an entry: of one with several, the first."""
    if "target_prompt" in entry:
        return str(entry["target_prompt"])
    return str(entry["target_changes"][0]).join(entry["target_prompt_list"])


def _records(folder: Path) -> Iterator[Mapping[str, Any]]:
    table = folder / "metadata.jsonl"
    if table.exists():
        try:
            for line in table.read_text().splitlines():
                yield json.loads(line)
        except ValueError as error:
            raise InputError(f"{table}: is no JSON: {error}") from None
        return
    files = sorted(folder.rglob("*.parquet"))
    if not files:
        raise InputError(f"{folder}: holds neither metadata.jsonl nor Parquet files")
    try:
        from pyarrow import parquet
    except ModuleNotFoundError:
        raise InputError(f"{folder}: reading Parquet files needs pip install pyarrow") from None
    for path in files:
        for batch in parquet.ParquetFile(path).iter_batches(batch_size=8):
            yield from batch.to_pylist()


def _scripted(
    folder: Path, name: str
) -> tuple[tuple[Mapping[str, Any], ...], dict[str, bytes]] | None:
    """Operations of the script of a picture, and the files that it names; None without one."""
    path = folder / "scripts" / f"{name}.json"
    if not path.exists():
        return None
    edits = parse(path.read_text(), str(path))
    sources = [str(e["source"]) for e in edits if e.get("op") == "insert" and "source" in e]
    return tuple(edits), {s: _read(path.parent, s) for s in sources}


def _masks(folder: Path, name: str, before: Pixels) -> tuple[Region, ...]:
    for path in (folder / "masks" / name, folder / "masks" / f"{name}.png"):
        if path.exists():
            return tuple(load_masks(path, before.shape[1], before.shape[0]))
    return ()


def _located(folder: Path, name: str) -> Path:
    """File that the set names from a folder above its own."""
    parts = Path(name).parts
    for k in range(len(parts)):
        if (folder / Path(*parts[k:])).exists():
            return folder / Path(*parts[k:])
    raise InputError(f"{folder}: holds no {name}")


def _read(folder: Path, name: str) -> bytes:
    try:
        return (folder / name).read_bytes()
    except OSError as error:
        raise InputError(f"{folder / name}: {error.strerror}") from None


def _opened(folder: Path, value: Any) -> Image.Image:
    """Picture of a column: the name of a file, or bytes as in Parquet files."""
    data = value["bytes"] if isinstance(value, Mapping) else _read(folder, str(value))
    try:
        picture = Image.open(io.BytesIO(data))
        picture.load()
    except (OSError, UnidentifiedImageError):
        raise InputError(f"{folder}: a picture cannot be read") from None
    return picture


def _rgb(folder: Path, value: Any) -> Pixels:
    return np.asarray(_opened(folder, value).convert("RGB"))


def _inside(folder: Path, value: Any) -> NDArray[np.bool_]:
    """Marked pixels of a mask: clear ones if some are, otherwise light ones."""
    picture = _opened(folder, value).convert("RGBA")
    alpha = np.asarray(picture)[..., 3]
    if (alpha < 128).any():
        return np.asarray(alpha < 128)
    return np.asarray(picture.convert("L")) >= 128


def operations(case: Case, folder: Path) -> Sequence[Mapping[str, Any]]:
    """Operations of a case whose files are written to a folder."""
    places = {}
    for k, (name, content) in enumerate(case.files.items()):
        places[name] = folder / f"{k}-{Path(name).name}"
        places[name].write_bytes(content)
    return [{**e, "source": str(places[e["source"]])} if e.get("source") in places else e
            for e in case.edits]  # fmt: skip
