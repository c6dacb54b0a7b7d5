"""Operation that gives a layer a new texture, made from words or after a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..errors import UnsupportedError
from ..limits import enough_memory
from ..model import Picture
from ..texture.implicit import ImplicitTexture
from .operations import changed, layer_named, operation


@operation("generate", layer="layer: the layer that changes, by name or position",
           prompt="text: what its texture shows; may be empty if the guide is a picture",
           guide="text: folder or file of a model, a picture file, or the name of a plug-in",
           negative="text?: what it does not show",
           guidance="number?: how many times the difference that the prompt makes counts",
           steps="integer?: steps of the optimizer; 400 by default",
           seed="integer?: seed of all random numbers; 0 by default",
           resolution="integer?: rows and columns of what the guide sees",
           times="pair?: least and greatest share of the timesteps; 0.02 and 0.98 by default",
           weighting="weighting?: weight of timesteps, sds by default",
           clip="number?: greatest norm of a gradient, for each sample of a picture",
           precision="precision?: numbers that the guide computes with, full by default",
           keep_structure="number?: how strongly edges of the old texture stay; 0 by default",
           effort="integer?: 1 to 9, how hard the result is encoded; 2 by default")  # fmt: skip
@enough_memory("to generate a texture; lower the resolution")
def generate(
    picture: Picture,
    layer: str | int,
    prompt: str,
    guide: str,
    times: Sequence[float] = (0.02, 0.98),
    **settings: Any,
) -> Picture:
    """Gives a layer a new texture, distilled from a model that knows what words look like.

    Shape, mesh and pose of the layer, and everything of other layers, stay as they are. An implicit
    texture gets its own copy of the network, a pyramid texture its own planes.

    Args:
        picture: The picture.
        layer: Name or position of the layer that changes.
        prompt: What the texture shows.
        guide: What tells how it should look; see `generate.guide`.
        times: Least and greatest share of the timesteps.
        settings: Other fields of `generate.settings.Settings`.

    Raises:
        UsageError: The layer, the guide, the prompt or a setting cannot be used.
        InputError: A model is wrong.
        UnsupportedError: A package or device is not there.
        LimitError: There is not enough memory.
    """
    from ..generate.run import present
    from ..generate.settings import Settings

    target = layer_named(picture, layer)
    chosen = Settings(prompt, guide, times=(times[0], times[1]), **settings)
    try:
        from ..generate.distill import generated
    except ModuleNotFoundError as error:
        raise UnsupportedError(
            f"generate needs {error.name}: pip install 'proxyimg-codec[generate]'"
        ) from None
    made = generated(picture, target, chosen, present())
    networks = list(picture.networks)
    texture = made.texture
    if isinstance(texture, ImplicitTexture):
        assert made.network is not None, "an implicit texture has a network"
        texture = replace(texture, network=len(networks))
        networks.append(made.network)
    new = replace(target, texture=texture)
    layers = [new if v.name == target.name else v for v in picture.layers]
    return changed(picture, layers, networks=networks)
