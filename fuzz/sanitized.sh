#!/usr/bin/env bash
# The kernel, built with address and undefined-behaviour sanitizers in a copy of the checkout, on all
# seeds and corpora of the fuzz targets: bash fuzz/sanitized.sh [PYTHON]
set -euo pipefail
cd "$(dirname "$0")/.."
python=${1:-python3}
case $python in */*) python=$PWD/$python ;; esac
copy=$(mktemp -d)
trap 'rm -rf "$copy"' EXIT
git ls-files -z | tar --null --create --files-from=- | tar --extract --directory="$copy"
cd "$copy"
${CXX:-g++} -shared -fPIC -std=c++20 -O1 -g -fno-omit-frame-pointer -pthread \
    -fsanitize=address,undefined -fno-sanitize-recover=undefined \
    proxyimg_codec/native/*.cpp -o proxyimg_codec/native/_kernel.so
library() { "${CXX:-g++}" -print-file-name="$1"; }
ASAN_OPTIONS=detect_leaks=0 \
    LD_PRELOAD="$(library libasan.so) $(library libubsan.so) $(library libstdc++.so)" \
    "$python" -m fuzz.replay tests/malformed/*.pxi
