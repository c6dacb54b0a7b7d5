"""Settings of the encoder, as plain data."""

from __future__ import annotations

import math
import operator
import os
from dataclasses import asdict, dataclass, fields
from typing import Any

from ..errors import UsageError
from ..texture.network import NetShape

PRESETS: dict[str, dict[str, Any]] = {
    "fast": {"effort": 2},
    "default": {},
    "best": {"effort": 8},
    "paper": {
        "texture": "implicit",
        "sampling": "node",
        "boundary": "chamfer",
        "feature_bits": 4,
        "net_bits": 4,
    },
}
"""Fields of `Settings` that each preset changes; ``paper`` is the method of ProxyImg."""

EFFORT, LARGE, LARGE_EFFORT = 5, 1 << 23, 4
"""Effort by default, and from how many pixels on it is how much."""

EFFORT_STEPS = (500, 1000, 2000, 5000, 10000, 16000, 24000, 40000, 60000)
"""Optimizer steps of implicit textures at effort 1..9; half of them train through rounding."""

NODE_SHARE = 0.3
"""Share of the steps that node sampling does, because each step costs several times as much."""

NODE_SPACING = 8.0
"""Canvas pixels between codes at quality 50 with node sampling (ProxyImg, o)."""

LAYERS_MAX = 64
"""Most layers of a picture that is encoded; the trainer composites at most as many in a pixel."""

TEXTURES = ("auto", "implicit", "pyramid")
TUNES = ("mse", "ms-ssim")
SAMPLINGS = ("direct", "node")
BOUNDARIES = ("lsq", "chamfer")
MATTES = ("auto", "hard", "soft")
TILES = ("auto", "always", "never")
BACKGROUNDS = ("auto", "smooth", "exemplar", "complete", "none")


@dataclass(frozen=True)
class Settings:
    """Settings of the encoder.

    Attributes:
        quality: Quality, 0..100. For a pyramid it sets the quantization step: about 0.05 to 2 bits
            per pixel on photographs. For implicit textures it sets the spacing of codes, the bits
            per code, and the width of the network.
        effort: Effort, 1..9; sets the number of optimizer steps or rounds of refinement; None = 5,
            and 4 for a picture of 8 megapixels or more.
        texture: Coder of textures: ``pyramid``, ``implicit`` or ``auto``, which is implicit if
            another setting needs it or the picture has a single colour, and pyramid otherwise.
        tune: Measure of errors: ``mse``, or ``ms-ssim``, by which they count less in busy parts of
            the picture; pyramid only.
        target_bpp: Most bits per pixel of the file, used up to 2 % where the picture needs them,
            instead of `quality`; pyramid only.
        target_size: Most bytes of the file, likewise; pyramid only.
        target_psnr: PSNR of the decoded picture in dB, within 0.1, instead of `quality`; pyramid
            only.
        max_layers: Most layers that the segmenter may find, 1..64; 1 does without it.
        segmenter: Name of the segmenter, see `plugins`; or a model: its path, or its name as
            `pxi-models` lists it.
        depth: Model that says which of the layers that are found are in front, as `segmenter`,
            or a plug-in of the kind `depth`; None leaves the order to the segmenter.
        feature_bits: Bits per code, 2..8; None = decided by `quality`; implicit only.
        net_bits: Bits per weight, 2..8; None = 8; implicit only.
        sampling: ``direct``, or ``node`` for the paper's method: features from mesh and boundary,
            and a network whose size does not depend on quality; implicit only.
        boundary: Fit of boundaries: ``lsq`` (least squares) or ``chamfer`` (the paper's).
        background: What layers hide: ``smooth`` (also ``diffuse``) continues what is around
            smoothly; ``exemplar`` copies what is around, pyramid only; ``auto`` is exemplar for
            pyramids where surroundings are not smooth, and smooth otherwise; ``complete`` stores
            codes that are optimized for smoothness, implicit only; ``none`` stores nothing and
            learns nothing, so that decoders fill it. Anything else is an inpainter that makes what
            is hidden of the back layer, as ``auto`` does for others: a plug-in of the kind
            `inpainters`, or a model as for `segmenter`; pyramid only.
        matte: What becomes of masks that are soft, such as those of hair: ``soft`` keeps the alpha
            of these layers, and finds that of all others from the colours along their outlines;
            ``hard`` cuts them at one half; ``auto`` keeps it where the mask has a soft rim that is
            wider than antialiasing, in opaque pictures with pyramids.
        mesh: Name of the mesher, see `plugins`; ``none`` stores no meshes, and edits make them when
            needed; None = delaunay for implicit textures, else none.
        tiles: Tiles of planes, by which regions decode their part of a file alone: ``always``,
            ``never``, or ``auto`` where a raster is large and they cost little; pyramid only.
        seed: Seed of all random numbers, 0..2**32 - 1.
        jobs: Number of threads, at least 1.
        device: ``cpu`` or ``cuda``; ``cuda`` is for implicit textures only.

    Raises:
        UsageError: A field has a wrong type or is out of range, or fields contradict each other.
    """

    quality: float = 50.0
    effort: int | None = None
    texture: str = "auto"
    tune: str = "mse"
    target_bpp: float | None = None
    target_size: float | None = None
    target_psnr: float | None = None
    max_layers: int = 4
    segmenter: str = "figures"
    depth: str | None = None
    feature_bits: int | None = None
    net_bits: int | None = None
    sampling: str = "direct"
    boundary: str = "lsq"
    background: str = "auto"
    matte: str = "auto"
    mesh: str | None = None
    tiles: str = "auto"
    seed: int = 0
    jobs: int = 2
    device: str = "cpu"

    def __post_init__(self) -> None:
        if self.background == "diffuse":
            object.__setattr__(self, "background", "smooth")
        try:
            for name in ("quality", "target_bpp", "target_size", "target_psnr"):
                if getattr(self, name) is not None:
                    object.__setattr__(self, name, float(getattr(self, name)))
            for name in ("effort", "max_layers", "net_bits", "seed", "jobs", "feature_bits"):
                value = getattr(self, name)
                if value is not None:
                    object.__setattr__(self, name, operator.index(value))
        except (TypeError, ValueError):
            raise UsageError("quality and targets must be numbers, other numeric settings "
                             "integers") from None  # fmt: skip
        checks = [
            (math.isfinite(self.quality) and 0 <= self.quality <= 100, "quality", "0..100"),
            (self.effort is None or 1 <= self.effort <= 9, "effort", "1..9"),
            (self.texture in TEXTURES, "texture", " or ".join(TEXTURES)),
            (self.tune in TUNES, "tune", " or ".join(TUNES)),
            (1 <= self.max_layers <= 64, "max_layers", "1..64"),
            (self.feature_bits is None or 2 <= self.feature_bits <= 8, "feature_bits", "2..8"),
            (self.net_bits is None or 2 <= self.net_bits <= 8, "net_bits", "2..8"),
            (self.sampling in SAMPLINGS, "sampling", " or ".join(SAMPLINGS)),
            (self.boundary in BOUNDARIES, "boundary", " or ".join(BOUNDARIES)),
            (
                isinstance(self.background, str) and self.background != "",
                "background",
                f"{', '.join(BACKGROUNDS)} or an inpainter",
            ),
            (self.matte in MATTES, "matte", " or ".join(MATTES)),
            (self.tiles in TILES, "tiles", " or ".join(TILES)),
            (0 <= self.seed < 1 << 32, "seed", "0..2^32-1"),
            (self.jobs >= 1, "jobs", "at least 1"),
            (self.device in ("cpu", "cuda"), "device", "cpu or cuda"),
        ]
        checks += [
            (value is None or (math.isfinite(value) and value > 0), f"target_{kind}", "positive")
            for kind, value in self._targets().items()
        ]
        for good, name, allowed in checks:
            if not good:
                raise UsageError(f"{name} is {getattr(self, name)}, but must be {allowed}")
        if self.sampling == "node" and self.mesh == "none":
            raise UsageError("sampling node needs a mesh; mesh none contradicts it")
        if self.sampling == "node" and self.background == "complete":
            raise UsageError("background complete needs sampling direct")
        self._check_coders()

    def _check_coders(self) -> None:
        """Raises `UsageError` if settings need different coders, or there are several targets."""
        aims = [f"target_{k}" for k, v in self._targets().items() if v is not None]
        if len(aims) > 1:
            raise UsageError(f"{' and '.join(aims)} contradict each other")
        aims += ["tune ms-ssim"] if self.tune != "mse" else []
        aims += ["tiles always"] if self.tiles == "always" else []
        aims += ["matte soft"] if self.matte == "soft" else []
        chosen = self.background == "exemplar" or self.inpainter is not None
        aims += [f"background {self.background}"] if chosen else []
        only = self._implicit_alone()
        if aims and only:
            raise UsageError(f"{only[0]} needs texture implicit, {aims[0]} texture pyramid")
        if self.texture == "pyramid" and only:
            raise UsageError(f"{only[0]} needs texture implicit")
        if self.texture == "implicit" and aims:
            raise UsageError(f"{aims[0]} needs texture pyramid")

    def _targets(self) -> dict[str, float | None]:
        return {"bpp": self.target_bpp, "size": self.target_size, "psnr": self.target_psnr}

    def _implicit_alone(self) -> list[str]:
        """Names of the changed settings that only the implicit coder has."""
        given = {
            "sampling node": self.sampling != "direct",
            "background complete": self.background == "complete",
            "feature_bits": self.feature_bits is not None,
            "net_bits": self.net_bits is not None,
            "device cuda": self.device != "cpu",
        }
        return [name for name, there in given.items() if there]

    @property
    def target(self) -> tuple[str, float] | None:
        """Kind of the target (``bpp``, ``size`` or ``psnr``) and its value, or None."""
        found = [(k, v) for k, v in self._targets().items() if v is not None]
        return found[0] if found else None

    @property
    def pyramid(self) -> bool:
        """Whether textures are pyramids, unless the picture has a single colour."""
        if self.texture == "auto":
            return not self._implicit_alone()
        return self.texture == "pyramid"

    @property
    def inpainter(self) -> str | None:
        """Name of the inpainter of the background, or None."""
        return None if self.background in BACKGROUNDS else self.background

    @property
    def mesher(self) -> str:
        """Name of the mesher, or ``none``."""
        return self.mesh or ("none" if self.pyramid else "delaunay")

    @property
    def weight_bits(self) -> int:
        """Bits per weight of the decoder network of implicit textures."""
        return self.net_bits or 8

    @property
    def step(self) -> int:
        """Index s of the pyramid's quantization step 2**(s / 64): 512 at quality 0, 128 at 100."""
        return round(512 - 3.84 * self.quality)

    @property
    def steps(self) -> int:
        """Optimizer steps of implicit textures; the unit of progress, 1000 for pyramids."""
        if self.pyramid:
            return 1000
        steps = EFFORT_STEPS[(self.effort or EFFORT) - 1]
        return round(NODE_SHARE * steps) if self.sampling == "node" else steps

    def effort_for(self, pixels: int) -> int:
        """Effort for a picture with so many pixels."""
        return self.effort or (EFFORT if pixels < LARGE else LARGE_EFFORT)

    @property
    def bits(self) -> int:
        """Bits per code."""
        if self.feature_bits is not None:
            return self.feature_bits
        return 3 if self.quality < 15 else 4 if self.quality < 80 else 5

    @property
    def spacing(self) -> float:
        """Distance of codes in canvas pixels: 14 at quality 0, 6.2 at 50, 2.75 at 100.

        With node sampling it is 8 at quality 50, and in proportion at others.
        """
        spacing = float(14.0 * (2.75 / 14.0) ** (self.quality / 100))
        if self.sampling == "node":
            spacing *= NODE_SPACING / math.sqrt(14.0 * 2.75)
        return spacing

    def network(self, pixels: int, channels: int) -> NetShape:
        """Sizes of the decoder network for direct sampling.

        The width grows with quality. It is less for pictures below 256 x 256, where the weights
        would take more bytes than the codes.

        Args:
            pixels: Number of visible pixels.
            channels: Outputs, 3 (colour) or 4 (colour and alpha).
        """
        width = 24 + 16 * self.quality / 100
        width *= min(1.0, (pixels / 65536) ** 0.25)
        return NetShape(8, 5, max(4 * round(width / 4), 8), 2, channels)

    def record(self) -> dict[str, Any]:
        """Settings that differ from the defaults, by name, to be recorded in the file.

        `jobs` and `device` are left out, so that the file does not depend on the machine, and so
        are the folders of models.
        """
        usual = {f.name: f.default for f in fields(self)}
        changed = {
            k: v
            for k, v in asdict(self).items()
            if k not in ("jobs", "device") and v != usual.get(k)
        }
        for name in ("segmenter", "depth", "background"):
            if name in changed:
                files = changed[name].split(os.pathsep)
                changed[name] = os.pathsep.join(os.path.basename(file) for file in files)
        return changed
