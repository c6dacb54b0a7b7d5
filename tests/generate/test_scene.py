"""The scene that torch draws is what the renderer draws, and its gradients are right."""

import subprocess
import sys

import numpy as np
import pytest
import torch

import proxyimg_codec as pxi
from proxyimg_codec.generate.crops import crops
from proxyimg_codec.generate.distill import parameters_of
from proxyimg_codec.generate.run import Run
from proxyimg_codec.generate.scene import scene_of
from tests.support.pictures import disc, smooth

CPU = torch.device("cpu")

POSES = {
    "at rest": lambda v: v.image,
    "moved": lambda v: v.moved(7.5, -3.25),
    "turned": lambda v: v.rotated(20),
    "bent": lambda v: v.dragged({(50, 20): (8, -3), (50, 55): (0, 0)}),
    "recoloured": lambda v: v.recoloured(hue=60, saturation=0.7),
    "faint": lambda v: v.with_opacity(0.6),
    "small": lambda v: v.scaled(0.6, 0.8),
}


def drawn(image, most=512):
    """The scene of the disc with its own texture, and what the renderer gives."""
    picture, layer = image.picture, image.layers["disc"].data
    scene = scene_of(picture, layer, most)
    parameters = parameters_of(picture, layer, scene, most, Run(), CPU)
    with torch.no_grad():
        found = scene.image(parameters.colours(0).straight)
    return scene, found.numpy().transpose(1, 2, 0)


@pytest.mark.parametrize("pose", POSES)
@pytest.mark.parametrize("coder", ["pyramid", "implicit"])
def test_it_shows_what_the_renderer_shows(pictures, coder, pose):
    image = POSES[pose](pictures[coder].layers["disc"])
    scene, found = drawn(image)
    whole = image.render(dtype=np.float32)
    x, y, w, h = scene.region
    away = np.abs(whole[y : y + h, x : x + w] - found)
    # The raster of the pyramid is coded anew, and its rim is not mixed with the background.
    assert away.mean() < (0.01 if coder == "pyramid" else 0.001)
    assert 0 < float(scene.share.max()) <= 1


@pytest.mark.parametrize("coder", ["pyramid", "implicit"])
def test_gradients_agree_with_finite_differences(pictures, coder):
    """Of a weighted sum of crops, by parameters, in float64."""
    image = pictures[coder].layers["disc"].rotated(12)
    picture, layer = image.picture, image.layers["disc"].data
    scene = scene_of(picture, layer, 512)
    parameters = parameters_of(picture, layer, scene, 512, Run(), CPU)
    leaves = doubled(parameters)
    direction = torch.randn(
        (2, 3, 16, 16), generator=torch.Generator().manual_seed(3), dtype=torch.float64
    )

    def value():
        views, _ = crops(
            scene.image(parameters.colours(0).straight), scene, 2, 16,
            torch.Generator().manual_seed(5),
        )  # fmt: skip
        return (views * direction).sum()

    gradients = torch.autograd.grad(value(), leaves)
    random = torch.Generator().manual_seed(7)
    step = 1e-3 if coder == "pyramid" else 1e-6  # the synthesis adds in float32
    for leaf, gradient in zip(leaves, gradients, strict=True):
        way = torch.randn(leaf.shape, generator=random, dtype=torch.float64)
        way /= way.norm()
        with torch.no_grad():
            leaf += step * way
            up = float(value())
            leaf -= 2 * step * way
            down = float(value())
            leaf += step * way
        want, size = float((gradient * way).sum()), float(gradient.norm())
        assert (up - down) / (2 * step) == pytest.approx(want, rel=1e-3, abs=5e-4 * size)


def doubled(parameters):
    """Parameters of a texture in float64, in place."""
    if hasattr(parameters, "_latents"):
        import copy

        parameters._model = copy.deepcopy(parameters._model).double()
        parameters._scale = parameters._scale.double()
        parameters._weights = parameters._weights.double()
        # Half as far from grey, as gradients go on where colours are cut off.
        halves = [(y.detach() / 2).double() for y in parameters._latents]
        parameters._latents = [y.requires_grad_() for y in halves]
        return parameters._latents
    parameters._fx, parameters._fy = parameters._fx.double(), parameters._fy.double()
    parameters._codes = parameters._codes.detach().double().requires_grad_()
    parameters._net = [p.detach().double().requires_grad_() for p in parameters._net]
    return [parameters._codes, *parameters._net]


def test_what_is_outside_of_the_coverage_gets_no_gradient(pictures):
    image = pictures["implicit"]
    scene = scene_of(image.picture, image.layers["disc"].data, 512)
    colours = torch.rand((len(scene.index), 3), requires_grad=True)
    outside = scene.share[None].expand(3, -1, -1) == 0
    (gradient,) = torch.autograd.grad(
        scene.image(colours)[outside].sum() + colours.sum() * 0, colours
    )
    assert not gradient.any()


def test_crops_show_the_layer_and_its_share(pictures):
    image = pictures["pyramid"]
    scene = scene_of(image.picture, image.layers["disc"].data, 512)
    marked = scene.share[None].expand(3, -1, -1)
    views, shown = crops(marked, scene, 40, 24, torch.Generator().manual_seed(1))
    torch.testing.assert_close(views[:, :1], shown)
    assert (shown.mean((1, 2, 3)) > 0.2).all()
    assert shown.mean((1, 2, 3)).std() > 0.05


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Linux tells the peak")
def test_a_scene_of_512_pixels_needs_less_than_a_gigabyte_and_a_half(tmp_path):
    """Of scene, parameters, crops and one step, beside the guide; in a process of its own."""
    pixels, mask = smooth(512, 512), disc(512, 512)
    pxi.encode(pixels, masks={"disc": mask}, effort=1, texture="pyramid").save(tmp_path / "a.pxi")
    code = f"""
import proxyimg_codec as pxi
from proxyimg_codec import plugins
from tests.support.guides import mixture_guide
plugins.find = lambda kind, name: lambda wishes: mixture_guide([[0.9, 0.2, 0.1]], 0)
image = pxi.open({str(tmp_path / "a.pxi")!r})
image.layers["disc"].generated("0", guide="mixture", steps=3, resolution=512, effort=1)
# Not ru_maxrss, which begins with the peak of the process that started this one.
print(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) * 1024 < 1.5e9
