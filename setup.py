"""Builds the optional compiled kernel; without a C++20 compiler the package works, slower."""

import glob
import os
import sys

from setuptools import Extension, setup

if sys.platform == "win32":
    flags, link = ["/std:c++20", "/O2"], []
else:
    # PROXYIMG_PORTABLE builds for any machine of the architecture instead of this one.
    target = [] if os.environ.get("PROXYIMG_PORTABLE") else ["-march=native"]
    flags = ["-std=c++20", "-O3", "-ffast-math", "-fno-finite-math-only", "-pthread", *target]
    link = ["-pthread"]

setup(
    ext_modules=[
        Extension(
            "proxyimg_codec.native._kernel",
            ["proxyimg_codec/native/kernel.cpp"],
            depends=sorted(glob.glob("proxyimg_codec/native/*.h")),
            extra_compile_args=flags,
            extra_link_args=link,
            optional=True,
        )
    ]
)
