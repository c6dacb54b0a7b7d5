"""Builds the optional compiled core; without a C++20 compiler the package works, slower.

The same source is compiled for several levels of processors into one library, which is loaded by
ctypes: so one wheel a platform serves all versions of Python. PROXYIMG_LEVELS=native builds for
this machine alone.
"""

import os
import shutil
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py

NATIVE = Path("proxyimg_codec/native")

# The baseline comes first: of functions of the C++ library that several levels instantiate, the
# linker keeps the first one.
TARGETS = {
    "baseline": [],
    "avx2": ["-march=x86-64-v3"],
    "avx512": ["-march=x86-64-v4", "-mprefer-vector-width=512"],
    "native": ["-march=native"],
}
X86 = sysconfig.get_platform().endswith(("x86_64", "amd64"))
ASKED = os.environ.get("PROXYIMG_LEVELS", "baseline avx2 avx512" if X86 else "baseline").split()
LEVELS = {name: flags for name, flags in TARGETS.items() if name in ASKED}
if not LEVELS or set(ASKED) - set(LEVELS):
    sys.exit(f"PROXYIMG_LEVELS: some of {', '.join(TARGETS)}, with spaces between")

COMMON = ["-std=c++20", "-O3", "-g0", "-pthread", "-fvisibility=hidden"]
if sys.platform == "win32":  # where gcc does not align the stack for vectors
    COMMON.append("-Wa,-muse-unaligned-vector-move")
# Sums in the order of the source and no fused operations: the same pixels on every level.
EXACT = ["-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math"]
FAST = ["-ffast-math", "-fno-finite-math-only"]
LINK = {
    "darwin": ["-Wl,-x"],
    "win32": ["-static", "-s", "-Wl,--no-insert-timestamp", "-Wl,--exclude-libs,ALL"],
}.get(
    sys.platform,
    [
        "-pthread",
        "-s",
        "-Wl,--build-id=none",
        "-Wl,--exclude-libs,ALL",
        "-static-libstdc++",
        "-static-libgcc",
    ],
)


class BuildLevels(build_ext):
    """Build of all levels into one library."""

    def get_ext_filename(self, fullname):
        """Name without the version of Python."""
        suffix = ".dll" if sys.platform == "win32" else ".so"
        return str(Path(*fullname.split("."))) + suffix

    def build_extension(self, ext):
        """Compiles each source for each level, and links."""
        sources = (("kernel.cpp", EXACT), ("refine.cpp", FAST), ("train.cpp", FAST))
        todo = [
            (source, level, [*maths, *target])
            for level, target in LEVELS.items()
            for source, maths in sources
        ]
        todo.append(("levels.cpp", *next(iter(LEVELS.items()))))
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            objects = list(pool.map(lambda one: self._compiled(*one), todo))
        self.compiler.link_shared_object(
            objects, self.get_ext_fullpath(ext.name), extra_postargs=LINK, target_lang="c++"
        )

    def _compiled(self, source, level, flags):
        folder = str(Path(self.build_temp) / level)
        macros = [("PXI_LEVEL", level)]
        [compiled] = self.compiler.compile(
            [str(NATIVE / source)], folder, macros, extra_postargs=[*COMMON, *flags]
        )
        return compiled


class BuildWithDecoder(build_py):
    """Build that takes the decoder in JavaScript along, for the pages that the studio exports."""

    def run(self):
        """Copies the modules."""
        super().run()
        if not self.editable_mode:
            target = Path(self.build_lib, "proxyimg_codec", "studio", "decoder")
            target.mkdir(parents=True, exist_ok=True)
            for module in sorted(Path("web/pxi").glob("*.js")):
                shutil.copy(module, target)


class WheelOfAnyPython(bdist_wheel):
    """Wheel for a platform and all versions of Python."""

    def get_tag(self):
        """Tag of the wheel."""
        return "py3", "none", super().get_tag()[2]


# Times of files in archives: those of the release if it says them, else always the same.
os.environ.setdefault("SOURCE_DATE_EPOCH", "1577836800")

setup(
    cmdclass={
        "build_ext": BuildLevels,
        "build_py": BuildWithDecoder,
        "bdist_wheel": WheelOfAnyPython,
    },
    ext_modules=[
        Extension(
            "proxyimg_codec.native._kernel",
            sorted(str(p) for p in NATIVE.glob("*.cpp")),
            depends=sorted(str(p) for p in NATIVE.glob("*.h")),
            optional=True,
        )
    ],
)
