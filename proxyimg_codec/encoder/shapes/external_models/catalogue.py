"""Models of other projects that are known to work, and the folders where they are sought.

Nothing here is downloaded by itself: `pxi-models get NAME` does it when asked.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

SAM, FIGURES, DEPTH, INPAINTING = "sam", "saliency", "depth", "inpainting"
"""Purposes of models: masks of anything, also of what is pointed at; what stands out; nearness;
what lies behind."""

FOLDERS = "PXI_MODELS"
"""Variable of the environment with folders of models, separated as those in PATH."""


@dataclass(frozen=True)
class File:
    """File of a model.

    Attributes:
        name: Its name in a folder of models.
        address: Where its project publishes it.
        size: About its size in bytes; None if it is not known.
        sha256: Its SHA-256 in hexadecimal; None if it is not known.
    """

    name: str
    address: str
    size: int | None = None
    sha256: str | None = None


@dataclass(frozen=True)
class Entry:
    """Known model.

    Attributes:
        name: Name in commands.
        purpose: What it is for: ``sam``, ``saliency``, ``depth`` or ``inpainting``.
        about: A few words about it.
        licence: Licence of its weights.
        project: Page of the project.
        files: Its files; of a SAM the encoder, then the decoder.
    """

    name: str
    purpose: str
    about: str
    licence: str
    project: str
    files: tuple[File, ...]


_REMBG = "https://github.com/danielgatis/rembg/releases/download/v0.0.0/"
_MOBILE = "https://huggingface.co/Acly/MobileSAM/resolve/main/"
_EFFICIENT = "https://raw.githubusercontent.com/yformer/EfficientSAM/main/weights/"
_SAM2 = "https://huggingface.co/vietanhdev/segment-anything-2-onnx-models/resolve/main/"
_LAMA = "https://huggingface.co/Carve/LaMa-ONNX/resolve/main/"
_DEPTH = "https://github.com/fabio-sim/Depth-Anything-ONNX/releases/download/"

# Checksums are those that at least two projects state independently of each other.
ENTRIES = (
    Entry(
        "mobilesam", SAM, "MobileSAM, one encoding in about a second", "Apache-2.0",
        "https://github.com/ChaoningZhang/MobileSAM",
        (
            File("mobile_sam_image_encoder.onnx", f"{_MOBILE}mobile_sam_image_encoder.onnx",
                 28_157_093, "580f5fb648ea1062c0aabc26217aed56921985f03f0cbbd852bba81d760cc749"),
            File("sam_mask_decoder_multi.onnx", f"{_MOBILE}sam_mask_decoder_multi.onnx",
                 16_500_000),
        ),
    ),
    Entry(
        "efficientsam", SAM, "EfficientSAM-Ti", "Apache-2.0",
        "https://github.com/yformer/EfficientSAM",
        (
            File("efficient_sam_vitt_encoder.onnx", f"{_EFFICIENT}efficient_sam_vitt_encoder.onnx",
                 24_799_761, "84ed466ffcc5c1f8d08409bc34a23bb364ab2c15e402cb12d4335a42be0e0951"),
            File("efficient_sam_vitt_decoder.onnx", f"{_EFFICIENT}efficient_sam_vitt_decoder.onnx",
                 16_565_728, "a62f8fa5ea080447c0689418d69e58f1e83e0b7adf9c142e2bd9bcc8045c0b11"),
        ),
    ),
    Entry(
        "sam2-tiny", SAM, "SAM 2, Hiera tiny", "Apache-2.0",
        "https://github.com/facebookresearch/sam2",
        (
            File("sam2_hiera_tiny.encoder.onnx", f"{_SAM2}sam2_hiera_tiny.encoder.onnx",
                 134_000_000),
            File("sam2_hiera_tiny.decoder.onnx", f"{_SAM2}sam2_hiera_tiny.decoder.onnx",
                 20_600_000),
        ),
    ),
    Entry(
        "sam-b", SAM, "SAM, ViT-B, weights of 8 bits", "Apache-2.0",
        "https://github.com/facebookresearch/segment-anything",
        (
            File("vit_b-encoder-quant.onnx", f"{_REMBG}vit_b-encoder-quant.onnx"),
            File("vit_b-decoder-quant.onnx", f"{_REMBG}vit_b-decoder-quant.onnx"),
        ),
    ),
    Entry(
        "u2netp", FIGURES, "U²-Net, small: what stands out", "Apache-2.0",
        "https://github.com/xuebinqin/U-2-Net",
        (File("u2netp.onnx", f"{_REMBG}u2netp.onnx", 4_574_861,
              "309c8469258dda742793dce0ebea8e6dd393174f89934733ecc8b14c76f4ddd8"),),
    ),
    Entry(
        "u2net", FIGURES, "U²-Net: what stands out", "Apache-2.0",
        "https://github.com/xuebinqin/U-2-Net",
        (File("u2net.onnx", f"{_REMBG}u2net.onnx", 175_997_641),),
    ),
    Entry(
        "isnet", FIGURES, "IS-Net, general use: what stands out, with fine borders", "Apache-2.0",
        "https://github.com/xuebinqin/DIS",
        (File("isnet-general-use.onnx", f"{_REMBG}isnet-general-use.onnx", 178_648_008,
              "60920e99c45464f2ba57bee2ad08c919a52bbf852739e96947fbb4358c0d964a"),),
    ),
    Entry(
        "isnet-anime", FIGURES, "IS-Net for anime: characters", "Apache-2.0",
        "https://github.com/SkyTNT/anime-segmentation",
        (File("isnet-anime.onnx", f"{_REMBG}isnet-anime.onnx"),),
    ),
    Entry(
        "depth-anything-v2-small", DEPTH, "Depth Anything V2, ViT-S", "Apache-2.0",
        "https://github.com/DepthAnything/Depth-Anything-V2",
        (File("depth_anything_v2_vits.onnx", f"{_DEPTH}v2.0.0/depth_anything_v2_vits.onnx",
              99_000_000),),
    ),
    Entry(
        "depth-anything-v2-base", DEPTH, "Depth Anything V2, ViT-B", "CC-BY-NC-4.0",
        "https://github.com/DepthAnything/Depth-Anything-V2",
        (File("depth_anything_v2_vitb.onnx", f"{_DEPTH}v2.0.0/depth_anything_v2_vitb.onnx"),),
    ),
    Entry(
        "lama", INPAINTING, "LaMa: what lies behind objects, seen at 512x512", "Apache-2.0",
        "https://github.com/advimman/lama",
        (File("lama_fp32.onnx", f"{_LAMA}lama_fp32.onnx", 208_044_816,
              "1faef5301d78db7dda502fe59966957ec4b79dd64e16f03ed96913c7a4eb68d6"),),
    ),
)  # fmt: skip
"""Known models; of those for the same purpose the first that is here is taken."""


def entry(name: str) -> Entry | None:
    """Known model of a name, or None."""
    return next((e for e in ENTRIES if e.name == name), None)


def cache_folder() -> Path:
    """Folder that downloads go to, by the XDG rules: ``~/.cache/proxyimg/models``."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    home = Path(base) if os.path.isabs(base) else Path.home() / ".cache"
    return home / "proxyimg" / "models"


def folders() -> list[Path]:
    """Folders where models are sought, in this order: those of `FOLDERS`, the cache."""
    given = os.environ.get(FOLDERS, "").split(os.pathsep)
    return [*(Path(v).expanduser() for v in given if v), cache_folder()]


def found(file: str) -> Path | None:
    """Path of a file in the first folder that has it, or None."""
    return next((p for p in (folder / file for folder in folders()) if p.is_file()), None)


def here(known: Entry) -> list[Path]:
    """Paths of the files of a known model; empty if one of them is missing."""
    paths = [found(file.name) for file in known.files]
    return [p for p in paths if p is not None] if all(paths) else []
