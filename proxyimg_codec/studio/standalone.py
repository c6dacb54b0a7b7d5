"""Page that holds a picture and a decoder, and needs nothing else: one file of HTML."""

from __future__ import annotations

import base64
import html
import json
import re
from importlib import resources
from pathlib import Path

from ..errors import UnsupportedError

DECODERS = (Path(__file__).parent / "decoder", Path(__file__).resolve().parents[2] / "web" / "pxi")
"""Folders of the decoder in JavaScript: that of a wheel, and that of a checkout."""

MODEL = "pyramid-1.bin"

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
html {{ color-scheme: light dark; }}
body {{ margin: 0; min-height: 100vh; display: grid; place-items: center; background: Canvas; }}
pxi-image {{ display: block; max-width: 100vw; }}
pxi-image canvas {{ display: block; width: 100%; height: auto; }}
</style>
<script type="importmap">{imports}</script>
<pxi-image src="data:application/octet-stream;base64,{picture}" role="img" aria-label="{title}">
</pxi-image>
<script type="module">
import {{ Image, render }} from "pxi/index.js";

const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const MODEL = bytesOf("{model}");

customElements.define("pxi-image", class extends HTMLElement {{
  async connectedCallback() {{
    const source = this.getAttribute("src");
    const image = await Image.open(bytesOf(source.slice(source.indexOf(",") + 1)), () => MODEL);
    const canvas = document.createElement("canvas");
    canvas.width = image.width;
    canvas.height = image.height;
    this.style.width = `${{image.width}}px`;
    this.replaceChildren(canvas);
    const draw = (t) => {{
      const {{ width, height, channels, data }} = render(image, {{ t, dtype: "uint8" }});
      const pixels = new Uint8ClampedArray(4 * width * height).fill(255);
      for (let i = 0, j = 0; i < pixels.length; i += 4, j += channels)
        for (let c = 0; c < channels; c++) pixels[i + c] = data[j + c];
      canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
    }};
    draw(null);
    if (!image.motion || matchMedia("(prefers-reduced-motion: reduce)").matches) return;
    const start = performance.now();
    const play = (now) => {{
      draw((now - start) / 1000);
      requestAnimationFrame(play);
    }};
    requestAnimationFrame(play);
  }}
}});
</script>
</html>
"""


def page_of(title: str, picture: bytes) -> bytes:
    """Page of HTML that shows a `.pxi` file and plays its motion, without a network.

    Args:
        title: Title of the page.
        picture: Bytes of the file.

    Raises:
        UnsupportedError: The decoder in JavaScript is not beside the package.
    """
    modules = next(filter(None, (sorted(place.glob("*.js")) for place in DECODERS)), [])
    if not modules:
        raise UnsupportedError(
            "the decoder in JavaScript, which is to be in the page, is not installed; "
            "install proxyimg-codec again"
        )
    imports = {f"pxi/{m.name}": _module(m.read_text("utf-8")) for m in modules}
    model = resources.files("proxyimg_codec.models").joinpath(MODEL).read_bytes()
    page = _PAGE.format(
        title=html.escape(title), imports=json.dumps({"imports": imports}),
        picture=base64.b64encode(picture).decode(), model=base64.b64encode(model).decode(),
    )  # fmt: skip
    return page.encode()


def _module(source: str) -> str:
    """Data URL of a module, which imports the others by names instead of places."""
    source = re.sub(r'from "\./', 'from "pxi/', source)
    source = re.sub(r'new URL\("[^"]*", import\.meta\.url\)', '""', source)
    return "data:text/javascript;base64," + base64.b64encode(source.encode()).decode()
