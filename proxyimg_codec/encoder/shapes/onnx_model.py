"""ONNX models, run by onnxruntime on the processor: one way to load them, with clear errors."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import resources
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from ...errors import InputError, LimitError, UnsupportedError

Array = NDArray[Any]
Floats = NDArray[np.float32]

NO_MEMORY = ("allocate memory", "Available memory", "bad_alloc", "bad allocation")
"""What messages of onnxruntime have in them when memory is short."""

KEPT = 5
"""Models that stay loaded for the next picture: an encoder, a decoder, a figure, a depth and an
inpainter."""


@dataclass(frozen=True)
class Tensor:
    """Input or output of a model.

    Attributes:
        name: Its name.
        shape: Lengths of its axes; None for those that are free.
        dtype: Type of its elements, as numpy calls it, such as ``float32``.
    """

    name: str
    shape: tuple[int | None, ...]
    dtype: str

    def __str__(self) -> str:
        """The tensor as errors show it, such as ``depth float32 [1, ?, ?]``."""
        lengths = ", ".join("?" if n is None else str(n) for n in self.shape)
        return f"{self.name} {self.dtype} [{lengths}]"


@dataclass(frozen=True, eq=False)
class Model:
    """Loaded model.

    Attributes:
        name: What errors call it: the path of its file.
        inputs: Its inputs, in their order.
        outputs: Its outputs, in their order.
        session: Session of onnxruntime.
    """

    name: str
    inputs: tuple[Tensor, ...]
    outputs: tuple[Tensor, ...]
    session: Any

    def run(self, feeds: Mapping[str, Array], wanted: Sequence[str] | None = None) -> list[Array]:
        """Runs the model.

        Args:
            feeds: Array for each input, by name; each is converted to the type of its input.
            wanted: Names of the outputs; None for all.

        Returns:
            The outputs, in the order of `wanted`.

        Raises:
            LimitError: There is not enough memory.
            InputError: The model does not run, or an output is not finite.
        """
        types = {t.name: t.dtype for t in self.inputs}
        given = {k: np.ascontiguousarray(v, types[k]) for k, v in feeds.items()}
        try:
            results = self.session.run(wanted, given)
        except Exception as error:  # onnxruntime's errors have no other base class
            raise _explained(self.name, "does not run", error) from None
        for value in results:
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise InputError(
                    f"{self.name}: the model gives values that are not finite (NaN or infinity); "
                    "it is damaged, or was converted to a type that is too small for it"
                )
        return list(results)


def load(path: str | os.PathLike[str], jobs: int = 1) -> Model:
    """Loads a model from a file; the last few stay loaded.

    Args:
        path: The file; weights beside it are found too.
        jobs: Threads to use.

    Raises:
        InputError: The file cannot be read, or is no ONNX model that runs.
        LimitError: There is not enough memory.
        UnsupportedError: onnxruntime is not installed.
    """
    name = os.fspath(path)
    try:
        state = os.stat(name)
        with open(name, "rb"):
            pass
    except OSError as error:
        raise InputError(f"{name}: cannot be read: {error.strerror}") from None
    total = memory()
    if total and state.st_size > total:
        raise LimitError(
            f"{name}: the model has {state.st_size >> 20} MiB, this machine {total >> 20} MiB of "
            "memory; use a smaller model"
        )
    return _loaded(name, jobs, state.st_mtime_ns, state.st_size)


@lru_cache(KEPT)
def _loaded(name: str, jobs: int, changed: int, size: int) -> Model:
    return _session(name, name, jobs)


@cache
def shipped(file: str, jobs: int = 1) -> Model:
    """Model that comes with this package, packed by Zstandard in its folder `models`.

    It stays loaded.

    Raises:
        LimitError: There is not enough memory.
        UnsupportedError: onnxruntime is not installed.
    """
    packed = (resources.files("proxyimg_codec.models") / file).read_bytes()
    return _session(file, zstandard.decompress(packed), jobs)


def _session(name: str, source: str | bytes, jobs: int) -> Model:
    runtime = _runtime()
    options = runtime.SessionOptions()
    options.intra_op_num_threads = jobs
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # errors are raised; nothing is printed
    options.add_session_config_entry("session.use_env_allocators", "1")
    try:
        session = runtime.InferenceSession(source, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no other base class
        raise _explained(name, "is not an ONNX model that onnxruntime can load", error) from None
    return Model(name, _tensors(session.get_inputs()), _tensors(session.get_outputs()), session)


@cache
def _runtime() -> Any:
    """Module onnxruntime, with an allocator that ends at the memory of the machine.

    Without an end the system would kill the process.
    """
    try:
        import onnxruntime
    except ModuleNotFoundError:
        raise UnsupportedError(
            "models need onnxruntime: pip install 'proxyimg-codec[encode]'"
        ) from None
    place = onnxruntime.OrtMemoryInfo(
        "Cpu", onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR, 0, onnxruntime.OrtMemType.DEFAULT
    )
    # Strategy 1 takes what is asked for, not the next power of two.
    limits = onnxruntime.OrtArenaCfg({"max_mem": memory(), "arena_extend_strategy": 1})
    onnxruntime.create_and_register_allocator(place, limits)
    return onnxruntime


def memory() -> int:
    """Memory of the machine in bytes; 0 where the system does not say."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 0


def _tensors(found: Sequence[Any]) -> tuple[Tensor, ...]:
    return tuple(
        Tensor(
            t.name,
            tuple(n if isinstance(n, int) and n > 0 else None for n in t.shape),
            _dtype(t.type),
        )
        for t in found
    )


def _dtype(kind: str) -> str:
    """Name that numpy has for a type of onnxruntime, such as ``tensor(float)``."""
    inner = kind.removeprefix("tensor(").removesuffix(")")
    return {"float": "float32", "double": "float64"}.get(inner, inner)


def _explained(name: str, what: str, error: Exception) -> InputError | LimitError:
    """Error for the user, made of one of onnxruntime."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError) or any(words in text for words in NO_MEMORY):
        return LimitError(
            f"{name}: the model needs more memory than there is; use a smaller model or picture"
        )
    return InputError(f"{name}: {what}: {text.rpartition(' : ')[2][:200]}")
