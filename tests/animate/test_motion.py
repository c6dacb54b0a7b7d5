import copy
import json
import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from proxyimg_codec.animate.materials import MATERIALS, Material
from proxyimg_codec.animate.motion import (
    PRESETS,
    Attachment,
    Collide,
    Disc,
    Handle,
    Impulse,
    Key,
    LayerMotion,
    Motion,
    Rectangle,
    Wind,
    preset,
)
from proxyimg_codec.animate.schema import check, schema
from proxyimg_codec.errors import InputError, UsageError

BOXES = {"hair": (100.0, 20.0, 220.0, 150.0), "body": (80.0, 100.0, 260.0, 500.0)}

FULL = {
    "version": 1,
    "duration": 3,
    "fps": 12,
    "loop": True,
    "seed": 7,
    "substeps": 9,
    "gravity": [0, 9.5],
    "drag": 0.25,
    "wind": {"direction": [0, -1], "strength": 2, "scale": 90, "frequency": 1, "gust": 0.1,
             "across": 0},
    "collide": {"canvas": True, "layers": True},
    "layers": {
        "hair": {
            "material": {"preset": "hair", "stretch": 4},
            "pins": ["top", {"at": [1, 2], "radius": 3}, {"box": [0, 0, 5, 6]}],
            "mass": 2,
            "floor": True,
            "upright": True,
            "impulses": [{"time": 1, "velocity": [0, -80], "at": [3, 4], "radius": 50},
                         {"velocity": [5, 0]}],
            "handles": [{"at": [1, 2], "radius": 30, "ease": "linear",
                         "keys": [{"time": 0, "offset": [1, 1]},
                                  {"time": 2, "scale": 1.1, "turn": 30}]}],
        },
        "*": {"material": "jelly"},
    },
    "attachments": [{"layers": ["hair", "body"], "at": [9, 9], "radius": 20}],
}  # fmt: skip


def changed(path, value):
    """FULL with another value at a path of keys; `...` removes the key."""
    values = copy.deepcopy(FULL)
    at = values
    for key in path[:-1]:
        at = at[key]
    if value is ...:
        del at[path[-1]]
    else:
        at[path[-1]] = value
    return values


def refusal(values):
    with pytest.raises(UsageError) as caught:
        Motion.from_json(json.dumps(values))
    return str(caught.value)


def test_json_says_what_the_motion_is():
    motion = Motion.from_json(json.dumps(FULL))
    assert motion == Motion(
        layers={
            "hair": LayerMotion(
                material=replace(MATERIALS["hair"], stretch=4),
                pins=("top", Disc((1, 2), 3), Rectangle((0, 0, 5, 6))),
                mass=2,
                floor=True,
                upright=True,
                impulses=(Impulse((0, -80), 1, (3, 4), 50), Impulse((5, 0))),
                handles=(
                    Handle((1, 2), 30, (Key(0, (1, 1)), Key(2, (0, 0), 1.1, 30)), "linear"),
                ),
            ),
            "*": LayerMotion(MATERIALS["jelly"]),
        },
        duration=3,
        fps=12,
        seed=7,
        substeps=9,
        gravity=(0, 9.5),
        drag=0.25,
        wind=Wind((0, -1), 2, 90, 1, 0.1, 0),
        collide=Collide(True, True),
        attachments=(Attachment(("hair", "body"), (9, 9), 20),),
    )  # fmt: skip
    assert (motion.frames, motion.steps, motion.period) == (36, 9, 3.0)


def test_motions_survive_json():
    motion = Motion.from_json(json.dumps(FULL))
    assert Motion.from_json(motion.to_json()) == motion
    for name in PRESETS:
        made = preset(name, BOXES, pins=["left", Disc((3.0, 4.0), 5.0)])
        assert Motion.from_json(made.to_json()) == made


def test_steps_do_not_get_longer_with_fewer_frames():
    for fps in (1, 5, 24, 30, 60, 240):
        motion = replace(Motion({"*": LayerMotion()}), fps=fps)
        assert motion.steps * fps >= 96
        assert motion.steps >= 4
    assert Motion({"*": LayerMotion()}, duration=0.01).frames == 1


def test_defaults_in_the_schema_are_those_of_the_code():
    motion = Motion({"a": LayerMotion()}, wind=Wind())
    tops, defs = schema()["properties"], schema()["$defs"]
    for part, rules in (
        (motion, tops),
        (motion.wind, defs["wind"]["properties"]),
        (motion.collide, defs["collide"]["properties"]),
        (LayerMotion(), defs["layer"]["properties"]),
        (Impulse((0.0, 0.0)), defs["impulse"]["properties"]),
        (Key(0.0), defs["key"]["properties"]),
        (Handle((0.0, 0.0), 1.0, ()), defs["handle"]["properties"]),
    ):
        names = {n for n in rules if n not in ("$schema", "version", "preset")}
        assert names == set(vars(part))
        for name, rule in rules.items():
            if "default" in rule and name != "material":
                have = getattr(part, name)
                assert (list(have) if isinstance(have, tuple) else have) == rule["default"]
    assert LayerMotion().material == MATERIALS[defs["layer"]["properties"]["material"]["default"]]
    assert set(defs["material"]["properties"]) == {"preset", *vars(MATERIALS["cloth"])}
    assert defs["named"]["enum"] == list(MATERIALS)
    assert tops["preset"]["enum"] == list(PRESETS)


WRONG = [
    (["layers", "hair", "pins", 1, "radius"], -3, "layers.hair.pins[1].radius: -3 is not positive"),
    (["layers", "hair", "pins", 0], "knee", 'layers.hair.pins[0]: "knee" is none of top, bottom'),
    (["layers", "hair", "pins", 0], {"at": [1, 2]}, "layers.hair.pins[0]: 'radius' is missing"),
    (["layers", "hair", "pins", 0], {"x": 1}, "neither one of top, bottom"),
    (["layers", "hair", "pins", 0], 3, "nor an object with at, radius or with box"),
    (["layers", "hair", "pins"], "top", 'layers.hair.pins: "top" is not a list'),
    (["layers", "hair", "mass"], math.nan, "layers.hair.mass: nan is not a finite number"),
    (["layers", "hair", "mass"], math.inf, "layers.hair.mass: inf is not a finite number"),
    (["layers", "hair", "mass"], "2", 'layers.hair.mass: "2" is not a number'),
    (["layers", "hair", "mass"], True, "layers.hair.mass: true is not a number"),
    (["layers", "hair", "material"], "wood", 'layers.hair.material: "wood" is none of cloth, hair'),
    (["layers", "hair", "material", "bend"], -1, "layers.hair.material.bend: -1 is out of range"),
    (["layers", "hair", "colour"], 1, "layers.hair: unknown key 'colour'; known are material"),
    (["layers", "hair", "impulses", 0, "at"], ..., "layers.hair.impulses[0]: 'at' is missing"),
    (["layers", "hair", "impulses", 0, "time"], 3, "impulses[0].time: 3 is not before the end"),
    (["layers", "hair", "handles", 0, "keys"], [], "layers.hair.handles[0].keys: has 0 items"),
    (["layers", "hair", "handles", 0, "keys", 0, "time"], 2, "keys[1].time: 2 does not come after"),
    (["layers", "hair", "handles", 0, "keys", 1, "time"], 3, "it must be equal to it"),
    (["layers", "hair", "handles", 0, "keys", 1, "time"], 4, "keys[1].time: 4 is after the end"),
    (["layers"], {}, "layers: has 0 properties"),
    (["layers"], ..., "neither 'layers' nor 'preset' is given"),
    (["fps"], 0, "fps: 0 is out of range; 1 to 240 is possible"),
    (["fps"], 12.5, "fps: 12.5 is not a whole number"),
    (["duration"], 0, "duration: 0 is not positive"),
    (["duration"], 601, "duration: 601 is out of range; more than 0 to 600 is possible"),
    (["duration"], 10**400, "is out of range"),
    (["seed"], -1, "seed: -1 is out of range"),
    (["loop"], 1, "loop: 1 is not true or false"),
    (["version"], 2, "version: 2 must be 1"),
    (["version"], True, "version: true must be 1"),
    (["version"], ..., "'version' is missing"),
    (["wind", "gust"], 1.5, "wind.gust: 1.5 is out of range; 0 to 1 is possible"),
    (["wind", "direction"], [0, 0], "wind.direction: 0, 0 points nowhere"),
    (["gravity"], [0, 1, 2], "gravity: has 3 items where 2 are possible"),
    (["gravity"], [0, math.nan], "gravity[1]: nan is not a finite number"),
    (["attachments", 0, "layers"], ["hair"] * 2, "attachments[0].layers: 'hair' is named twice"),
    (["pres et"], 1, "unknown key 'pres et'; known are $schema, version, preset, duration"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "message"), WRONG)
def test_an_error_names_the_place(path, value, message):
    assert message in refusal(changed(path, value))


@pytest.mark.parametrize("value", [[], 1, None, "motion", {"version": 1}])
def test_what_is_no_motion_is_refused(value):
    refusal(value)


@pytest.mark.parametrize("text", ["", "{", '{"version": 1', "[" * 100_000, "\x00"])
def test_what_is_no_json_is_refused(text):
    with pytest.raises(UsageError, match="is not valid JSON"):
        Motion.from_json(text)


def test_a_million_steps_are_refused():
    message = refusal({**changed(["duration"], 600), "fps": 240, "substeps": 8})
    assert "600 s at 240 fps with 8 substeps are 1152000 steps; at most 100000" in message


def test_motions_made_in_code_are_checked_too():
    with pytest.raises(UsageError, match="drag: nan is not a finite number"):
        Motion({"a": LayerMotion()}, drag=math.nan)
    with pytest.raises(UsageError, match=r"layers\.a\.material\.stretch: -1.* is out of range"):
        Motion({"a": LayerMotion(Material(-1.0, 1, 1, 1, 1, 1, 1))})


def test_reading_names_the_file(tmp_path):
    path = tmp_path / "motion.json"
    with pytest.raises(InputError, match=r"motion\.json: cannot be read"):
        Motion.read(path)
    path.write_text('{"version": 1, "layers": {"a": {}}, "fps": 0}')
    with pytest.raises(UsageError, match=r"motion\.json: fps: 0 is out of range"):
        Motion.read(path)
    path.write_text('{"version": 1, "layers": {"a": {}}, "fps": 10.0}')
    assert repr(Motion.read(path).fps) == "10"


def test_a_preset_fills_in_what_is_not_given():
    values = {
        "version": 1,
        "preset": "sway",
        "duration": 2,
        "wind": {"strength": 9},
        "layers": {"hair": {"pins": ["top"]}},
    }
    motion = Motion.from_json(json.dumps(values), BOXES)
    plain = preset("sway", {"hair": BOXES["hair"]}, duration=2)
    assert motion == replace(
        plain,
        wind=replace(plain.wind, strength=9),
        layers={"hair": replace(plain.layers["hair"], pins=("top",))},
    )
    every = Motion.from_json('{"version": 1, "preset": "jelly"}', BOXES)
    assert every == preset("jelly", BOXES)
    starred = {"version": 1, "preset": "jelly", "layers": {"*": {}, "hair": {"mass": 3}}}
    motion = Motion.from_json(json.dumps(starred), BOXES)
    assert motion.layers["hair"].mass == 3
    assert motion.layers["body"] == every.layers["body"]


def test_presets_pin_what_the_canvas_cuts_off():
    boxes = {"whole": (20.0, 10.0, 60.0, 80.0), "cut": (0.4, 30.0, 50.0, 99.2)}
    for name in PRESETS:
        plain, made = preset(name, boxes), preset(name, boxes, canvas=(160, 100))
        assert made.layers["whole"] == plain.layers["whole"]
        own = plain.layers["cut"].pins
        assert made.layers["cut"].pins == (*own, *(s for s in ("bottom", "left") if s not in own))
        values = json.dumps({"version": 1, "preset": name, "layers": {"cut": {}}})
        assert {"bottom", "left"} <= {
            *Motion.from_json(values, boxes, (160, 100)).layers["cut"].pins
        }
    assert preset("sway", boxes).collide.canvas


def test_a_full_turn_ends_where_it_began():
    keys = [{"time": 0}, {"time": 1, "turn": 200}, {"time": 3, "turn": 360}]
    values = changed(["layers", "hair", "handles", 0, "keys"], keys)
    assert Motion.from_json(json.dumps(values)).layers["hair"].handles[0].keys[-1].turn == 360
    keys[-1]["turn"] = 350
    assert "it must be equal to it" in refusal(values)


def test_presets_name_what_is_missing():
    with pytest.raises(UsageError, match="there is no preset 'hop'; there are sway, breeze"):
        preset("hop", BOXES)
    with pytest.raises(UsageError, match="has no layer to move"):
        preset("sway", {})
    text = '{"version": 1, "preset": "sway", "layers": {"hat": {}}}'
    with pytest.raises(UsageError, match="no layer 'hat'; there are: 'hair', 'body'"):
        Motion.from_json(text, BOXES)
    for duration in (0, -1, math.nan):
        with pytest.raises(UsageError, match="duration"):
            preset("jelly", BOXES, duration=duration)


def test_presets_scale_with_the_picture():
    double = {name: tuple(2 * v for v in box) for name, box in BOXES.items()}
    for name in PRESETS:
        small, large = preset(name, BOXES), preset(name, double)
        assert large.gravity == pytest.approx(tuple(2 * v for v in small.gravity))
        for key in BOXES:
            pairs = zip(small.layers[key].impulses, large.layers[key].impulses, strict=True)
            for a, b in pairs:
                assert b.velocity == pytest.approx(tuple(2 * v for v in a.velocity))


LEAVES = st.one_of(
    st.integers(-2, 700), st.floats(-2, 700), st.booleans(), st.none(), st.just([1, 2]),
    st.sampled_from(["top", "cloth", "linear", "sway", "a"]), st.just({}), st.just([]),
    st.just({"at": [0, 0], "radius": 1}), st.just({"box": [0, 0, 1, 1]}), st.just({"shape": 1}),
)  # fmt: skip


def places(value, path=()):
    """Paths of all values inside a JSON value."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, item in items:
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from places(item, (*path, key))


@given(st.sampled_from(list(places(FULL))), st.one_of(LEAVES, st.just(...)), st.booleans())
@settings(max_examples=400, deadline=None)
def test_the_checks_agree_with_the_published_schema(path, value, beside):
    if beside and isinstance(path[-1], str):
        path = (*path[:-1], path[-1] + "s")
        value = 1 if value is ... else value
    values = changed(path, value)
    jsonschema = pytest.importorskip("jsonschema")
    valid = jsonschema.Draft202012Validator(schema()).is_valid(values)
    try:
        check(values)
    except UsageError:
        assert not valid, values
    else:
        assert valid, values


def test_the_schema_is_one():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(schema())
