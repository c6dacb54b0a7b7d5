"""Encoder settings: quality and effort as data."""

from __future__ import annotations

import math
import operator
from dataclasses import asdict, dataclass
from typing import Any

from ..errors import UsageError
from ..texture.network import NetShape

PRESETS: dict[str, dict[str, Any]] = {
    "fast": {"effort": 2},
    "default": {"effort": 5},
    "best": {"effort": 8},
    "paper": {"sampling": "node", "boundary": "chamfer", "feature_bits": 4, "net_bits": 4},
}
"""Settings of each preset, where they differ from the defaults; ``paper`` is ProxyImg's method."""

EFFORT_STEPS = (500, 1000, 2000, 5000, 10000, 16000, 24000, 40000, 60000)
"""Optimizer steps at effort 1..9; half of them with quantization in the loop."""

NODE_SHARE = 0.3
"""Node sampling takes that share of the steps, for each costs several times as much."""

NODE_SPACING = 8.0
"""Canvas pixels between codes at quality 50 with node sampling (ProxyImg, o)."""

SAMPLINGS = ("direct", "node")
BOUNDARIES = ("lsq", "chamfer")
BACKGROUNDS = ("diffuse", "complete")


@dataclass(frozen=True)
class Settings:
    """What an encode is asked for.

    Attributes:
        quality: 0..100; sets density of codes, bits and width of the network.
        effort: 1..9; sets the number of optimizer steps.
        max_layers: Most layers of the decomposition; 1 = none.
        segmenter: Who decomposes; see `plugins`.
        feature_bits: Bits a code, 2..8; None = from quality.
        net_bits: Bits a weight, 2..8.
        sampling: ``direct``, or ``node`` (the paper's method: features from mesh and boundary, and
            its network, whatever the quality).
        boundary: ``lsq`` (least squares) or ``chamfer`` (the paper's fit).
        background: ``diffuse`` (hidden codes of the back layer are filled when decoding) or
            ``complete`` (they are optimized for smoothness and stored).
        mesh: Who makes proxy nodes, see `plugins`; ``none`` leaves them out.
        seed: Seed of everything random.
        jobs: Threads, at least 1.
        device: ``cpu`` or ``cuda``.
    """

    quality: float = 50.0
    effort: int = 5
    max_layers: int = 4
    segmenter: str = "regions"
    feature_bits: int | None = None
    net_bits: int = 8
    sampling: str = "direct"
    boundary: str = "lsq"
    background: str = "diffuse"
    mesh: str = "delaunay"
    seed: int = 0
    jobs: int = 2
    device: str = "cpu"

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "quality", float(self.quality))
            for name in ("effort", "max_layers", "net_bits", "seed", "jobs", "feature_bits"):
                value = getattr(self, name)
                if name != "feature_bits" or value is not None:
                    object.__setattr__(self, name, operator.index(value))
        except (TypeError, ValueError):
            raise UsageError("quality must be a number, other numeric settings integers") from None
        checks = [
            (math.isfinite(self.quality) and 0 <= self.quality <= 100, "quality", "0..100"),
            (1 <= self.effort <= 9, "effort", "1..9"),
            (1 <= self.max_layers <= 64, "max_layers", "1..64"),
            (self.feature_bits is None or 2 <= self.feature_bits <= 8, "feature_bits", "2..8"),
            (2 <= self.net_bits <= 8, "net_bits", "2..8"),
            (self.sampling in SAMPLINGS, "sampling", " or ".join(SAMPLINGS)),
            (self.boundary in BOUNDARIES, "boundary", " or ".join(BOUNDARIES)),
            (self.background in BACKGROUNDS, "background", " or ".join(BACKGROUNDS)),
            (0 <= self.seed < 1 << 32, "seed", "0..2^32-1"),
            (self.jobs >= 1, "jobs", "at least 1"),
            (self.device in ("cpu", "cuda"), "device", "cpu or cuda"),
        ]
        for good, name, allowed in checks:
            if not good:
                raise UsageError(f"{name} is {getattr(self, name)}, but must be {allowed}")
        if self.sampling == "node" and self.mesh == "none":
            raise UsageError("sampling node needs a mesh; mesh none contradicts it")
        if self.sampling == "node" and self.background == "complete":
            raise UsageError("background complete needs sampling direct")

    @property
    def steps(self) -> int:
        """Optimizer steps."""
        steps = EFFORT_STEPS[self.effort - 1]
        return round(NODE_SHARE * steps) if self.sampling == "node" else steps

    @property
    def bits(self) -> int:
        """Bits a code."""
        if self.feature_bits is not None:
            return self.feature_bits
        return 3 if self.quality < 15 else 4 if self.quality < 80 else 5

    @property
    def spacing(self) -> float:
        """Canvas pixels between codes: 14 at quality 0, 6.2 at 50, 2.75 at 100.

        With node sampling 8 at quality 50, and the others in proportion.
        """
        spacing = float(14.0 * (2.75 / 14.0) ** (self.quality / 100))
        if self.sampling == "node":
            spacing *= NODE_SPACING / math.sqrt(14.0 * 2.75)
        return spacing

    def network(self, pixels: int, channels: int) -> NetShape:
        """Shape of the network for a picture of so many visible pixels.

        Width grows with quality, and shrinks with small pictures, where the weights would
        outweigh the codes.
        """
        width = 24 + 16 * self.quality / 100
        width *= min(1.0, (pixels / 65536) ** 0.25)
        return NetShape(8, 5, max(4 * round(width / 4), 8), 2, channels)

    def record(self) -> dict[str, Any]:
        """What is written into the file about its making; nothing of the machine."""
        return {k: v for k, v in asdict(self).items() if k not in ("jobs", "device")}
