"""Encoding in several threads gives the same bytes, and leaves the process as it was."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

import proxyimg_codec as pxi
from proxyimg_codec.encoder import settings
from proxyimg_codec.encoder.implicit.fit_torch import interpolate
from proxyimg_codec.encoder.pyramid import engine_torch, refine
from proxyimg_codec.encoder.pyramid import picture as pyramid
from proxyimg_codec.encoder.pyramid.encode import EFFORTS
from proxyimg_codec.encoder.pyramid.goal import Effort
from proxyimg_codec.encoder.shapes import chamfer
from proxyimg_codec.native import kernel
from tests.support.paths import ROOT
from tests.support.pictures import disc, smooth

MASKED = {"texture": "implicit", "effort": 1, "masks": True}
WAYS = {
    **{f"effort {e}": {"effort": e} for e in range(1, 10)},
    "another seed": {"effort": 8, "seed": 3},
    "ms-ssim": {"effort": 2, "tune": "ms-ssim"},
    "grey": {"effort": 9, "grey": True},
    "layers": {"effort": 8, "masks": True},
    "implicit": MASKED,
    "chamfer": {**MASKED, "boundary": "chamfer"},
    "complete": {**MASKED, "background": "complete"},
    "node": {**MASKED, "sampling": "node"},
}
QUICK = [Effort(min(e.steps, 7), min(e.rounds, 5)) for e in EFFORTS]


def encoded(masks=False, grey=False, **options):
    """Bytes of a small picture."""
    picture = smooth(27, 19)
    how = {"masks": [pxi.Region("disc", disc(27, 19))]} if masks else {"max_layers": 1}
    return pxi.encode(picture[..., 0] if grey else picture, jobs=1, **how, **options).to_bytes()


def hurry(patch):
    """Fewer steps of all kinds."""
    patch.setattr(pyramid, "EFFORTS", QUICK)
    patch.setattr(settings, "EFFORT_STEPS", (60,) * 9)
    patch.setattr(chamfer.fit_paths_chamfer, "__defaults__", (0.25, 4, 40, 20, 2e-3, 4.0))


@pytest.mark.parametrize("compiled", [True, False])
def test_threads_do_not_change_the_bytes(monkeypatch, compiled):
    """Whatever they encode at the same time."""
    hurry(monkeypatch)
    ways = list(WAYS.values())
    if not compiled:
        monkeypatch.setattr(kernel, "library", lambda: None)
        ways = [MASKED, {"effort": 8}]
    alone = [encoded(**way) for way in ways]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda way: encoded(**way), [*ways, *reversed(ways)]))
    assert together == [*alone, *reversed(alone)]


SCRIPT = """
import gc, locale, os, random, signal, sys, warnings
import cv2
import numpy as np
import torch
import torch._dynamo  # it sets filters of warnings and a variable when optimizers are first used
{first}
def state():
    umask = open("/proc/self/status").read().split("Umask:")[1].split()[0]
    return {{
        "torch": torch.get_rng_state().tolist(), "numpy": str(np.random.get_state()),
        "python": random.getstate(), "threads": torch.get_num_threads(),
        "cv2": cv2.getNumThreads(), "type": torch.get_default_dtype(),
        "deterministic": torch.are_deterministic_algorithms_enabled(),
        "grad": torch.is_grad_enabled(), "onednn": torch.backends.mkldnn.flags,
        "errors": np.geterr(), "warnings": list(warnings.filters), "umask": umask,
        "locale": locale.setlocale(locale.LC_ALL), "recursion": sys.getrecursionlimit(),
        "signals": [signal.getsignal(n) for n in signal.valid_signals()],
        "folder": os.getcwd(), "interval": sys.getswitchinterval(), "collector": gc.get_threshold(),
        "streams": (sys.stdin, sys.stdout, sys.stderr), "hook": sys.excepthook,
        "denormal": float(np.float32(1e-40) * np.float32(0.5)),
        "files": sorted(map(os.readlink, map("/proc/self/fd/{{}}".format, "012"))),
    }}
environment = dict(os.environ)
before = state()
from tests.encoder import test_threads
test_threads.hurry(test_threads.pytest.MonkeyPatch())
for way in test_threads.WAYS.values():
    data = test_threads.encoded(**way)
    image = test_threads.pxi.from_bytes(data)
    image.render(width=13)
    image.layers[-1].moved(2, 1).save(sys.argv[1])
assert dict(os.environ) == environment
after = state()
for name in before:
    assert before[name] == after[name], name
assert after["denormal"] > 0
"""


WAIT = {"OMP_WAIT_POLICY": "PASSIVE"}


def process(script, *args, **environment):
    """Runs a script, with no variables that decide how threads wait but these; its stderr."""
    own = {k: v for k, v in os.environ.items() if k not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")}
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, args)], env={**own, **environment},
        capture_output=True, text=True, cwd=ROOT, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stderr


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="Linux tells the umask")
@pytest.mark.parametrize("first", ["", "torch.set_num_threads(3); torch.manual_seed(7)"])
def test_encoding_leaves_the_process_as_it_was(tmp_path, first):
    process(SCRIPT.format(first=first), tmp_path / "a.pxi", **WAIT)


ENCODE = """
import cv2, numpy, os
import proxyimg_codec as pxi
before = dict(os.environ)
pxi.encode(numpy.arange(192, dtype=numpy.uint8).reshape(8, 8, 3), effort=1, tune="ms-ssim")
assert dict(os.environ) == before
"""
TOOL = """
import sys
from proxyimg_codec.cli import encode
sys.exit(encode.main(sys.argv[1:]))
"""


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="the OpenMP of GCC tells how it waits"
)
@pytest.mark.parametrize(
    ("script", "set_by_user", "policy"),
    [
        (ENCODE, {}, "PASSIVE"),
        (TOOL, {}, "PASSIVE"),
        (ENCODE, {"OMP_WAIT_POLICY": "ACTIVE"}, "ACTIVE"),
        (TOOL, {"GOMP_SPINCOUNT": "7"}, "7"),
    ],
    ids=["package", "tool", "package, active", "tool, count"],
)
def test_threads_wait_without_spinning_unless_somebody_asks_for_it(
    tmp_path, script, set_by_user, policy
):
    (tmp_path / "a.ppm").write_bytes(b"P6 8 8 255 " + bytes(range(192)))
    tool = (tmp_path / "a.ppm", "-e", "1", "--tune", "ms-ssim", "--quiet")
    said = process(script, *tool, OMP_DISPLAY_ENV="VERBOSE", **set_by_user)
    lines = [line.split("=")[1].strip(" '") for line in said.splitlines() if
             ("GOMP_SPINCOUNT" if policy == "7" else "OMP_WAIT_POLICY") in line]  # fmt: skip
    assert lines == [policy]


@pytest.fixture(params=[2, 3, 5])
def torch_threads(request):
    """Runs a function with one thread of torch and with more, and compares what it returns."""
    before = torch.get_num_threads()

    def compare(function):
        torch.set_num_threads(1)
        one = function()
        torch.set_num_threads(request.param)
        for _ in range(5):
            assert torch.equal(function(), one)

    yield compare
    torch.set_num_threads(before)


def test_torch_threads_do_not_change_sums(torch_threads):
    x = torch.rand(1, 3, 341, 257, generator=torch.Generator().manual_seed(1))
    torch_threads(lambda: refine.sums(x))
    mixed = x.contiguous(memory_format=torch.channels_last)
    torch_threads(lambda: refine.sums(mixed))


def test_torch_threads_do_not_change_shifts(torch_threads):
    random = torch.Generator().manual_seed(2)
    offset, scale = (torch.randn(1, 9, 211, 173, generator=random) for _ in range(2))
    torch_threads(lambda: torch.from_numpy(engine_torch.bits_of(offset, scale, torch.ones(1))))


def test_torch_threads_do_not_change_gradients_of_codes(torch_threads):
    random = torch.Generator().manual_seed(3)
    codes = torch.randn(900, 16, generator=random, requires_grad=True)
    base = torch.randint(800, (20_001,), generator=random)
    fx, fy = torch.rand(2, 20_001, generator=random)

    def gradient():
        return torch.autograd.grad(interpolate(codes, base, 30, fx, fy).square().sum(), codes)[0]

    torch_threads(gradient)
