"""Wrong decoders are caught."""

import functools

import pytest

from conformance import runner
from conformance.faults import decoder as wrong_decoder
from tests.conformance.decoders import (
    BY_NAME,
    command,
    in_process,
    problems,
)

CAUGHT = {
    # fault: (case that catches it, kind of problem, case that it passes or "")
    "half-pixel": ("one-layer", "pixels", "invalid-crc-head"),
    "layer-order": ("layers", "pixels", "one-layer"),
    "ignores-holes": ("hole", "pixels", "layers"),
    "even-odd": ("winding", "pixels", "hole"),
    "hard-edges": ("layers", "pixels", "one-layer"),
    "coarse-coverage": ("layers", "pixels", "one-layer"),
    "points-floored": ("enlarged", "pixels", "layers"),
    "coarse-curves": ("layers", "pixels", "one-layer"),
    "escape-narrow": ("escape", "exit", "layers"),
    "swaps-channels": ("one-layer", "pixels", "invalid-names"),
    "not-premultiplied": ("alpha", "pixels", "layers"),
    "drops-alpha": ("no-back", "pixels", "one-layer"),
    "zeros-for-diffusion": ("diffusion", "pixels", "layers"),
    "no-smoothing": ("diffusion", "pixels", "layers"),
    "nearest": ("one-layer", "pixels", "invalid-order"),
    "no-octaves": ("octaves-7", "pixels", "octaves-0"),
    "no-averaging": ("reduced", "pixels", "layers"),
    "keeps-background": ("layer-subset", "pixels", "layers"),
    "ignores-layers": ("layer-subset", "pixels", "layers"),
    "ignores-region": ("region", "size", "layers"),
    "no-halving": ("adaptation", "exit", "one-layer"),
    "nan": ("pixel", "pixels", "invalid-empty"),
    "one-row-short": ("layers", "size", "invalid-empty"),
    "eight-bit": ("one-layer", "output", "invalid-empty"),
    "writes-nothing": ("one-layer", "output", "invalid-empty"),
    "writes-rubbish": ("one-layer", "output", "invalid-empty"),
    "accepts-bad-crc": ("invalid-crc-texture", "exit", "layers"),
    "accepts-trailing-bytes": ("invalid-trailing-byte", "exit", "layers"),
    "ignores-critical-chunks": ("unsupported-chunk", "exit", "ancillary"),
    "accepts-left-over-words": ("invalid-codes-long", "exit", "layers"),
    "accepts-any-step": ("invalid-step-nan", "exit", "layers"),
    "accepts-any-encoding": ("invalid-long-integer", "exit", "invalid-key-missing"),
    "accepts-more-values": ("invalid-value-more", "exit", "invalid-value-missing"),
    "accepts-any-order-of-keys": ("invalid-key-order", "exit", "version-0-3"),
    "refuses-maps": ("version-0-2", "exit", "arrays-0-2"),
    "ignores-poses": ("moved", "pixels", "layers"),
    "ignores-displacements": ("bent", "pixels", "moved"),
    "ignores-texture-displacements": ("texture-displaced", "pixels", "bent"),
    "ignores-opacity": ("opacity", "pixels", "moved"),
    "ignores-colour": ("colours-alpha", "pixels", "opacity"),
    "bends-after-mapping": ("bent-turned", "pixels", "bent"),
    "boundary-stays": ("bent", "pixels", "moved"),
    "rides-floored": ("bent", "pixels", "moved"),
    "boundary-undivided": ("pieces", "pixels", "moved"),
    "back-always-covers": ("turned-back", "pixels", "turned"),
    "maps-floored": ("turned", "pixels", "bent"),
    "maps-unclamped": ("clamped", "pixels", "turned"),
    "no-closing": ("closing-1", "pixels", "bent"),
    "children-turned": ("closing-deep", "pixels", "closing-1"),
    "ranks-by-number": ("bent", "exit", "moved"),
    "midpoints-not-predicted": ("closing-1", "pixels", "bent"),
    "last-face-wins": ("overlap", "pixels", "bent"),
    "turned-faces-win": ("folded", "pixels", "overlap"),
    "mirrored-faces-swap": ("folded-flipped", "pixels", "folded"),
    "first-face-beyond": ("beyond", "pixels", "bent"),
    "rest-beyond": ("beyond", "pixels", "bent"),
    "stops-beyond": ("beyond", "pixels", "bent"),
    "fine-weights": ("wide", "pixels", "bent"),
    "matrix-before-clamping": ("colours", "pixels", "invalid-names"),
    "matrix-not-clamped": ("colours", "pixels", "opacity"),
    "draws-hidden": ("hidden", "pixels", "moved"),
    "never-draws-hidden": ("hidden", "pixels", "layers"),
    "shared-texture-of-the-back": ("shared", "pixels", "moved"),
    "shared-box": ("shared", "pixels", "moved"),
    "local-is-direct": ("node-local", "pixels", "node"),
    "follows-parents": ("tree", "pixels", "moved"),
    "believes-histories": ("undo-stale", "exit", "undo"),
    "accepts-contradictions": ("invalid-opaque-moved", "exit", "opaque-posed"),
    "reads-maps-in-all-versions": ("invalid-map", "exit", "version-0-3"),
    "reads-only-0.11": ("version-0-2", "exit", "layers"),
    "reads-the-future": ("unsupported-version-0-4", "exit", "layers"),
    "accepts-idle-poses": ("invalid-pose-rest", "exit", "moved"),
    "causal-off-by-one": ("pyramid", "exit", "pyramid-sample"),
    "causal-reversed": ("pyramid", "exit", "pyramid-sample"),
    "context-floored": ("pyramid", "exit", "layers"),
    "features-truncated": ("pyramid", "exit", "layers"),
    "chroma-first": ("pyramid", "exit", "pyramid-grey"),
    "waves-too-steep": ("pyramid", "exit", "pyramid-row"),
    "ignores-support": ("pyramid-one-cell", "exit", "pyramid-sample"),
    "codes-bands-that-are-not-there": ("pyramid-odd-levels", "exit", "pyramid-padded"),
    "support-of-padded-everywhere": ("pyramid-support", "exit", "pyramid-padded-support"),
    "pads-all-models": ("pyramid-odd", "exit", "pyramid-padded"),
    "pads-no-model": ("pyramid-padded", "exit", "pyramid-odd"),
    "context-odd-mirrored-as-even": ("pyramid-odd-levels", "exit", "pyramid-padded"),
    "synthesis-odd-mirrored-as-even": ("pyramid-odd-levels", "pixels", "pyramid-padded"),
    "context-not-mirrored": ("pyramid", "exit", "pyramid-one-level"),
    "context-high-mirrored-as-low": ("pyramid", "exit", "pyramid-one-level"),
    "synthesis-not-mirrored": ("pyramid-one-level", "pixels", "pyramid-sample"),
    "ignores-shifts": ("pyramid-shifts", "exit", "pyramid"),
    "ignores-grey-levels": ("pyramid-grey-levels", "exit", "pyramid"),
    "one-level-set": ("pyramid", "exit", "pyramid-one-level"),
    "ignores-step": ("pyramid", "pixels", "layers"),
    "codes-certain-latents": ("pyramid-one-cell", "exit", "layers"),
    "escapes-unsigned": ("pyramid-escapes", "exit", "pyramid-sample"),
    "accepts-left-over-escapes": ("invalid-escapes-long", "exit", "pyramid"),
    "accepts-large-latents": ("invalid-latent-high", "exit", "pyramid"),
    "nearest-sample": ("pyramid-enlarged", "pixels", "pyramid-odd"),
    "linear": ("pyramid-enlarged", "pixels", "pyramid-odd"),
    "cubic-sharp": ("pyramid-enlarged", "pixels", "pyramid-odd"),
    "samples-on-corners": ("pyramid-odd", "pixels", "pyramid-sample"),
    "interpolates-straight": ("pyramid-alpha", "pixels", "pyramid-enlarged"),
    "ignores-part": ("pyramid-part", "pixels", "pyramid"),
    "ignores-alpha-planes": ("pyramid-alpha", "pixels", "pyramid"),
    "ignores-mask": ("pyramid-moved", "pixels", "pyramid"),
    "fills-black": ("pyramid-moved", "pixels", "pyramid"),
    "ignores-cuts": ("pyramid-cuts", "pixels", "pyramid-moved"),
    "cuts-mixed-samples": ("pyramid-cuts-several", "pixels", "pyramid-moved"),
    "keeps-rims": ("pyramid-cuts-moved", "pixels", "pyramid-moved"),
    "keeps-rims-of-its-own": ("pyramid-cuts-moved", "pixels", "pyramid-moved"),
    "keeps-rims-of-what-is-not-drawn": ("pyramid-cuts-subset", "pixels", "pyramid-cuts-other"),
    "keeps-rims-of-what-is-bent-or-shines-through": (
        "pyramid-cuts-opacity",
        "pixels",
        "pyramid-cuts-moved",
    ),
    "keeps-rims-of-what-is-recoloured": ("pyramid-cuts-colour", "pixels", "pyramid-cuts-moved"),
    "keeps-rims-of-another-raster": ("pyramid-cuts-other", "pixels", "pyramid-cuts-moved"),
    "keeps-mixed-colours": ("pyramid-cuts-subset", "pixels", "pyramid-moved"),
    "unmixes-always": ("pyramid-cuts-filled", "pixels", "pyramid-cuts-subset"),
    "fills-own-rims": ("pyramid-cuts-subset", "pixels", "pyramid-moved"),
    "unmixes-by-coverage-alone": ("pyramid-cuts-subset", "pixels", "pyramid-moved"),
    "unmixes-with-what-is-far": ("pyramid-cuts-subset", "pixels", "pyramid-moved"),
    "loses-rims-everywhere": ("pyramid-cuts-moved", "pixels", "pyramid-moved"),
    "loses-rims-of-what-moves-together": ("pyramid-cuts-together", "pixels", "pyramid-cuts-moved"),
    "trusts-mixed-samples": ("pyramid-cuts", "pixels", "pyramid-moved"),
    "trusts-samples-near": ("pyramid-cuts", "pixels", "pyramid-moved"),
    "ignores-behind": ("behind", "pixels", "copies"),
    "ignores-alpha-behind": ("behind-alpha", "pixels", "behind-opaque"),
    "behind-over-trusted": ("behind", "pixels", "copies"),
    "behind-without-cells": ("behind", "pixels", "behind-alpha"),
    "ignores-references": ("copies", "pixels", "behind"),
    "offsets-down-first": ("copies", "pixels", "copies-none"),
    "sources-without-upper-bits": ("copies-many", "pixels", "copies"),
    "copies-without-overlap": ("copies", "pixels", "copies-fine"),
    "copies-what-is-not-known": ("copies", "pixels", "behind"),
    "copies-without-rim": ("copies", "pixels", "copies-no-rim"),
    "copies-not-clamped": ("copies-clamped", "pixels", "copies-no-rim"),
    "ignores-motion": ("moves-loop", "pixels", "moved"),
    "moves-without-a-time": ("moves-loop", "pixels", "moved"),
    "linear-curves": ("moves-loop", "pixels", "moves-loop-1"),
    "curves-through-coefficients": ("moves-loop", "pixels", "moves-loop-1"),
    "stops-at-the-end": ("moves-loop", "pixels", "moves-once"),
    "always-loops": ("moves-once", "pixels", "moves-loop"),
    "end-is-the-beginning": ("moves-once", "pixels", "moves-loop"),
    "mirrors-negative-times": ("moves-loop", "pixels", "moves-unit-0"),
    "whole-frames": ("moves-loop", "pixels", "moves-loop-1"),
    "loops-do-not-wrap": ("moves-loop", "pixels", "moves-once"),
    "interval-late": ("moves-loop", "pixels", "moves-loop-1"),
    "interval-early": ("moves-loop", "pixels", "moves-loop-1"),
    "curves-not-summed": ("moves-loop", "pixels", "moves-loop-1"),
    "curves-summed-over-layers": ("moves-layers", "pixels", "moves-loop"),
    "one-curve-for-all": ("moves-loop", "pixels", "moves-unit-0"),
    "first-shape-only": ("moves-loop", "pixels", "moves-unit-0"),
    "shapes-in-one-row": ("moves-loop", "exit", "moves-unit-0"),
    "shapes-without-midpoints": ("moves-layers", "pixels", "moves-loop"),
    "moves-the-first-meshes": ("moves-layers", "exit", "moves-loop"),
    "ignores-unit": ("moves-unit-6", "pixels", "moves-loop"),
    "x-for-y": ("moves-loop", "pixels", "moves-nowhere"),
    "motion-floored": ("moves-loop", "pixels", "moves-nowhere"),
    "motion-unclamped": ("moves-far", "pixels", "moves-loop"),
    "forgets-bends": ("moves-posed", "pixels", "moves-loop"),
    "moves-after-mapping": ("moves-posed", "pixels", "moves-loop"),
    "still-where-nothing-moves": ("moves-nowhere", "pixels", "moves-loop"),
    "bodies-apart": ("moves-together", "pixels", "moves-apart"),
    "one-body": ("moves-apart", "pixels", "moves-together"),
    "bodies-rest-on-all": ("moves-nowhere", "pixels", "moves-loop"),
    "accepts-large-curves": ("invalid-motion-curve-high", "exit", "invalid-motion-shape-high"),
    "accepts-large-shapes": ("invalid-motion-shape-low", "exit", "invalid-motion-curve-low"),
    "accepts-any-motion": ("invalid-motion-back", "exit", "moves-loop"),
    "exit-code-1": ("invalid-empty", "exit", "layers"),
    "exit-code-0": ("invalid-empty", "exit", "layers"),
}


def test_every_fault_has_its_catcher():
    assert CAUGHT.keys() | {"hangs"} == wrong_decoder.FAULTS.keys()


@pytest.mark.parametrize("fault", CAUGHT)
@pytest.mark.filterwarnings("ignore:(invalid value|overflow|divide)")
def test_wrong_decoders_are_caught(fault):
    catcher, kind, spared = CAUGHT[fault]
    decoder = functools.partial(in_process, fault=fault)
    caught = problems(runner.run([BY_NAME[catcher]], decoder))
    assert caught
    assert f": {kind}: " in caught[0]
    assert problems(runner.run([BY_NAME[spared]], decoder)) == []


@pytest.mark.parametrize("case", ["closing-1", "closing-2", "closing-3", "closing-deep"])
@pytest.mark.parametrize("fault", ["no-closing", "boundary-stays", "ignores-displacements"])
def test_every_kind_of_closing_counts(case, fault):
    decoder = functools.partial(in_process, fault=fault)
    assert ": pixels: " in problems(runner.run([BY_NAME[case]], decoder))[0]


def test_a_wrong_decoder_is_caught_as_a_command(capsys, at_root):
    wrong = command("-m", "conformance.faults", "--fault", "ignores-holes")
    assert runner.main(["--decoder", wrong, "--only", "hole"]) == 1
    assert "pixels: peak" in capsys.readouterr().out
