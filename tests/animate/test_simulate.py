from dataclasses import replace

import numpy as np
import pytest

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
from proxyimg_codec.animate.simulate import Body, simulate
from proxyimg_codec.animate.system import System
from proxyimg_codec.errors import UsageError
from tests.support.bodies import areas, box, sheet
from tests.support.images import changed

CANVAS = (200, 160)
JELLY = MATERIALS["jelly"]
LIMP = Material(0, 0, 0, 0, 0, 1, 1)


def moved(bodies, motion):
    return simulate(bodies, motion, canvas=CANVAS).displacements


def once(layer, **values):
    """A motion of one layer that does not loop, without drag."""
    return Motion({"sheet": layer}, **{"loop": False, "duration": 1.0, "drag": 0.0, **values})


@pytest.fixture(scope="module")
def presets():
    """Two bodies, and the looping frames of every preset."""
    bodies = [sheet(), sheet("disc", 60, 60, 10, (90, 50), 1)]
    boxes = {b.name: box(b) for b in bodies}
    return bodies, {name: moved(bodies, preset(name, boxes, fps=12)) for name in PRESETS}


@pytest.mark.parametrize("name", PRESETS)
def test_presets_move_and_keep_their_triangles(presets, name):
    bodies, frames = presets
    for body in bodies:
        away = frames[name][body.name]
        assert away.shape == (48, len(body.nodes), 2)
        length = np.hypot(*np.moveaxis(away, 2, 0))
        least = 0.003 if name == "breathe" else 0.01
        assert length.mean() > least * body.diagonal
        assert length.max() < 0.3 * body.diagonal
        least = areas(body.nodes + away, body.faces) / body.areas
        assert least.min() > 0.3


@pytest.mark.parametrize("name", PRESETS)
def test_loops_close(presets, name):
    """From the last frame to the first it is no further than between others."""
    bodies, frames = presets
    for body in bodies:
        away = frames[name][body.name]
        steps = np.abs(np.roll(away, -1, 0) - away).max((1, 2))
        assert steps[-1] <= steps[:-1].max()
        still = np.abs(np.diff(away, axis=0)).max((1, 2)) == 0
        assert not still.any()


@pytest.mark.parametrize("name", ["sway", "breeze", "jelly", "wave", "flame"])
def test_presets_hold_their_pins(presets, name):
    bodies, frames = presets
    side = {"sway": "bottom", "breeze": "top", "jelly": "bottom", "wave": "left",
            "flame": "bottom"}[name]  # fmt: skip
    for body in bodies:
        pinned = body.caught(side, "")
        assert 0 < pinned.sum() < len(pinned) / 2
        assert np.abs(frames[name][body.name][:, pinned]).max() <= 1e-6
        assert np.abs(frames[name][body.name][:, ~pinned]).max(2).max(0).min() > 0


def test_the_jelly_keeps_its_area(presets):
    bodies, frames = presets
    for body in bodies:
        away = frames["jelly"][body.name]
        total = areas(body.nodes + away, body.faces).sum(1) / body.areas.sum()
        assert np.abs(total - 1).max() < 0.05


@pytest.mark.parametrize("name", PRESETS)
def test_energy_is_bounded_by_the_work_done(name):
    body = sheet()
    system = System([body], preset(name, {"sheet": box(body)}), CANVAS, measured=True)
    first, most, top = system.energy(), -np.inf, 0.0
    for _ in range(400):
        system.step()
        energy = system.energy()
        most, top = max(most, energy - first - system.work), max(top, energy)
    assert top > 1e3
    assert most <= 1e-9 * top


def test_energy_of_a_free_swing_is_nearly_kept_with_short_steps():
    """So the bound above is not met by losing everything at once."""
    layer = LayerMotion(replace(JELLY, drag=0), ("left",), impulses=(Impulse((0, 60)),))
    system = System([sheet()], once(layer, substeps=100), CANVAS, measured=True)
    energies = []
    for _ in range(600):
        system.step()
        energies.append(system.energy())
    assert energies[0] == pytest.approx(system.work, rel=0.01)
    assert max(energies) <= energies[0] * (1 + 1e-9)
    assert energies[-1] > 0.8 * energies[0]


def test_the_work_of_handles_counts():
    keys = (Key(0), Key(0.5, (30, 0)))
    layer = LayerMotion(JELLY, ("left",), handles=(Handle((140, 75), 30, keys),))
    system = System([sheet()], once(layer), CANVAS, measured=True)
    for _ in range(60):
        system.step()
        assert system.energy() <= system.work + 1e-6
    assert system.energy() > 0.3 * system.work > 100


def test_free_fall_is_a_parabola():
    motion = once(LayerMotion(LIMP), gravity=(10.0, 90.0))
    away = moved([sheet()], motion)["sheet"]
    t = np.arange(24)[:, None] / 24
    h = 1 / 96
    wanted = 0.5 * np.array([10.0, 90.0]) * t * (t + h)  # of steps that add speed, then move
    np.testing.assert_allclose(away, np.broadcast_to(wanted[:, None], away.shape), atol=1e-9)


def test_drag_takes_speed_away_exponentially():
    layer = LayerMotion(replace(LIMP, drag=1.0), impulses=(Impulse((96.0, 0.0), 0.0),))
    away = moved([sheet()], once(layer, drag=2.0))["sheet"]
    speed = np.diff(away[:, 0, 0])
    np.testing.assert_allclose(speed[1:] / speed[:-1], np.exp(-3 / 24))


def test_a_pendulum_swings_at_its_length():
    """Two triangles on a pin: edges keep their length, and the period is that of gravity."""
    nodes = np.array([[100.0, 20.0], [96.0, 60.0], [104.0, 60.0], [100.0, 100.0]])
    body = Body("sheet", nodes, np.array([[0, 2, 1], [1, 2, 3]]))
    stiff = Material(100, 100, 100, 0, 0, 1, 0)
    layer = LayerMotion(stiff, (Disc((100, 20), 1),), impulses=(Impulse((40, 0)),))
    motion = once(layer, gravity=(0, 400), duration=8, substeps=60)
    x = nodes + moved([body], motion)["sheet"]
    a, b = body.sides[0].T
    length = np.hypot(*np.moveaxis(x[:, a] - x[:, b], 2, 0))
    np.testing.assert_allclose(length, np.broadcast_to(length[0], length.shape), rtol=0.01)
    assert (x[:, 0] == nodes[0]).all()
    side = np.sign(x[:, 3, 0] - 100)
    turns = np.flatnonzero(side[1:] * side[:-1] < 0) / 24
    masses = np.array([1, 2, 2, 1]) * 1.0
    arm = nodes[1:] - nodes[0]
    inertia = (masses[1:] * (arm**2).sum(1)).sum()
    wanted = 2 * np.pi * np.sqrt(inertia / (400 * (masses[1:] * arm[:, 1]).sum()))
    assert 2 * np.diff(turns).mean() == pytest.approx(wanted, rel=0.05)


def test_shape_brings_nodes_back_at_its_frequency():
    layer = LayerMotion(replace(LIMP, shape=2.0), ("left",), impulses=(Impulse((0, 50)),))
    away = moved([sheet()], once(layer, duration=3, substeps=100))["sheet"][:, -1, 1]
    turns = np.flatnonzero(away[2:] * away[1:-1] < 0) / 24
    assert 2 * np.diff(turns).mean() == pytest.approx(0.5, rel=0.1)


def test_a_rigid_layer_stays_rigid_and_a_cloth_does_not():
    strain = {}
    for name in ("rigid", "cloth"):
        layer = LayerMotion(MATERIALS[name], (Disc((80, 30), 8),))
        motion = once(layer, wind=Wind(strength=2, gust=0.5, across=0.5, scale=60))
        body = sheet()
        away = moved([body], motion)["sheet"]
        assert np.hypot(*np.moveaxis(away, 2, 0)).mean() > 0.5
        a, b = body.sides[0].T
        ends = body.nodes + away
        length = np.hypot(*np.moveaxis(ends[:, a] - ends[:, b], 2, 0))
        strain[name] = np.abs(length / length[0] - 1).max()
    assert strain["rigid"] < 0.02
    assert strain["cloth"] > 3 * strain["rigid"]


def test_the_same_input_gives_the_same_bytes_and_seeds_differ():
    body = sheet()
    motion = preset("sway", {"sheet": box(body)}, duration=0.5)
    first, again = moved([body], motion)["sheet"], moved([sheet()], motion)["sheet"]
    assert first.tobytes() == again.tobytes()
    other = moved([body], replace(motion, seed=1))["sheet"]
    assert np.abs(first - other).max() > 0.5


def test_handles_lead_and_scale():
    keys = (Key(0), Key(0.5, (6, -2), 1.5))
    layer = LayerMotion(JELLY, ("border",), handles=(Handle((80, 75), 20, keys, "linear"),))
    body = sheet()
    away = moved([body], once(layer, duration=1))["sheet"]
    held = np.hypot(*(body.nodes - (80, 75)).T) <= 20
    wanted = 0.5 * (body.nodes[held] - (80, 75)) + (6, -2)
    np.testing.assert_allclose(away[12:, held], np.broadcast_to(wanted, away[12:, held].shape))
    np.testing.assert_allclose(away[6, held], wanted / 2)
    beside = ~held & (np.hypot(*(body.nodes - (80, 75)).T) < 33)
    assert np.abs(away[-1, beside]).max() > 1  # the jelly follows


def test_handles_turn():
    keys = (Key(0), Key(0.5, turn=90))
    layer = LayerMotion(JELLY, ("border",), handles=(Handle((80, 75), 20, keys, "linear"),))
    body = sheet()
    away = moved([body], once(layer, duration=0.75))["sheet"]
    arms = body.nodes - (80, 75)
    held = np.hypot(*arms.T) <= 20
    for frame, angle in ((6, np.pi / 4), (12, np.pi / 2)):
        c, s = np.cos(angle), np.sin(angle)
        turned = np.stack([c * arms[:, 0] - s * arms[:, 1], s * arms[:, 0] + c * arms[:, 1]], 1)
        np.testing.assert_allclose(away[frame, held], (turned - arms)[held], atol=1e-9)


def test_breathing_loops():
    keys = (Key(0), Key(1, scale=1.2))
    layer = LayerMotion(JELLY, ("border",), handles=(Handle((80, 75), 25, keys),))
    away = moved([sheet()], Motion({"sheet": layer}, duration=2))["sheet"]
    inside = np.abs(away).max((0, 2)) > 0.5
    np.testing.assert_allclose(away[1:24, inside], away[:24:-1, inside], atol=0.8)
    assert np.abs(away[24]).max() > 4 > 10 * np.abs(away[0]).max()


def test_attached_layers_stay_together():
    bodies = [sheet("sheet"), sheet("disc", 60, 60, 10, (90, 50), 1)]
    layers = {"sheet": LayerMotion(JELLY, ("left",), impulses=(Impulse((0, -80)),)),
              "disc": LayerMotion(JELLY)}  # fmt: skip
    attachment = Attachment(("disc", "sheet"), (120, 80), 18)
    loose = moved(bodies, Motion(layers, loop=False, duration=1))
    tied = moved(bodies, Motion(layers, loop=False, duration=1, attachments=(attachment,)))
    at = np.hypot(*(bodies[1].nodes - (120, 80)).T) <= 18
    corners, weights = bodies[0].holding(bodies[1].nodes[at])

    def apart(frames):
        onto = (frames["sheet"][:, corners] * weights[..., None]).sum(2)
        return np.abs(frames["disc"][:, at] - onto).max()

    assert apart(loose) > 5
    assert apart(tied) < 0.1 * apart(loose)


def test_a_layer_can_be_attached_to_one_that_stands_still():
    bodies = [sheet("sheet"), sheet("disc", 60, 60, 10, (90, 50), 1)]
    attachment = Attachment(("disc", "sheet"), (120, 80), 18)
    motion = Motion({"disc": LayerMotion(MATERIALS["rigid"])}, loop=False, gravity=(0, 100),
                    attachments=(attachment,))  # fmt: skip
    frames = moved(bodies, motion)
    assert list(frames) == ["disc"]
    assert np.abs(frames["disc"]).max() < 20
    free = moved(bodies, replace(motion, attachments=()))
    assert np.abs(free["disc"]).max() > 300


def test_layers_stay_on_the_canvas_and_on_their_floor():
    layer = LayerMotion(JELLY, impulses=(Impulse((300, -200)),))
    motion = once(layer, gravity=(0, 300), duration=2)
    body = sheet()
    x = body.nodes + moved([body], replace(motion, collide=Collide(canvas=True)))["sheet"]
    assert x.min() >= 0
    assert (x.max((0, 1)) <= CANVAS).all()
    assert x.max((0, 1)) == pytest.approx(CANVAS)
    floored = moved([body], changed(motion, layers={"sheet": replace(layer, floor=True)}))["sheet"]
    y = (body.nodes + floored)[..., 1]
    assert y.max() <= body.nodes[:, 1].max()
    assert y[8:].max() == pytest.approx(body.nodes[:, 1].max())


def test_layers_push_each_other_away():
    bodies = [sheet("sheet", 60, 60, 10, (0, 30)), sheet("disc", 60, 60, 10, (70, 35))]
    layers = {"sheet": LayerMotion(JELLY, impulses=(Impulse((60, 0)),)), "disc": LayerMotion(JELLY)}
    motion = Motion(layers, loop=False, duration=1, collide=Collide(layers=True))
    frames = moved(bodies, motion)
    assert frames["disc"][-1, :, 0].mean() > 5
    right = (bodies[0].nodes + frames["sheet"])[..., 0].max(1)
    left = (bodies[1].nodes + frames["disc"])[..., 0].min(1)
    assert (right - left).max() < 3


def test_impulses_repeat_in_a_loop():
    layer = LayerMotion(replace(LIMP, shape=3, drag=6), ("left",),
                        impulses=(Impulse((0, 90), 0.25),))  # fmt: skip
    away = np.abs(moved([sheet()], Motion({"sheet": layer}, duration=1))["sheet"]).max((1, 2))
    assert away[:7].max() < 0.1 * away.max()
    assert 7 <= away.argmax() <= 10


def test_slivers_and_loose_nodes_do_no_harm():
    body = sheet()
    count = len(body.nodes)
    nodes = np.concatenate([body.nodes, [[26.0, 30.0], [80, 30], [80, 30], [300, 300]]])
    extra = [[0, count, 1], [count + 1, count + 2, 5], [2, 3, 2]]  # on a line, in a point, twice
    broken = Body("sheet", nodes, np.concatenate([body.faces, extra]))
    layer = LayerMotion(JELLY, ("bottom",), impulses=(Impulse((50, 0)),))
    away = moved([broken], once(layer, wind=Wind()))["sheet"]
    assert np.isfinite(away).all()
    assert np.abs(away).max() < 100
    loose = away[:, -1]
    nearest = np.hypot(*(body.nodes - (300, 300)).T).argmin()
    assert (loose == away[:, nearest]).all()


def test_extremes_stay_finite():
    layer = LayerMotion(Material(100, 100, 100, 100, 1000, 1e-3, 1000), ("centre",), 1e3,
                        impulses=(Impulse((1e6, -1e6)),))  # fmt: skip
    motion = once(layer, gravity=(1e6, 1e6), drag=1000.0, wind=Wind(strength=1000.0))
    assert np.isfinite(moved([sheet()], motion)["sheet"]).all()
    free = once(LayerMotion(impulses=(Impulse((1e6, -1e6)),)), gravity=(1e6, 1e6))
    assert np.isfinite(moved([sheet()], free)["sheet"]).all()


def refusal(motion, bodies=None):
    with pytest.raises(UsageError) as caught:
        simulate(bodies or [sheet()], motion, canvas=CANVAS)
    return str(caught.value)


def test_errors_name_what_is_missing():
    far = Disc((500.0, 75.0), 5.0)
    message = refusal(once(LayerMotion(pins=("top", far))))
    assert message.startswith(
        "layers.sheet.pins[1]: no node of layer 'sheet' lies within 5 px of 500, 75; the nearest "
    )
    message = refusal(once(LayerMotion(pins=(Rectangle((300, 0, 5, 5)),))))
    assert "layers.sheet.pins[0]: no node of layer 'sheet' lies in this box" in message
    handle = Handle(far.at, far.radius, (Key(0),))
    assert "layers.sheet.handles[0]: no node" in refusal(once(LayerMotion(handles=(handle,))))
    impulse = Impulse((1, 1), at=far.at, radius=far.radius)
    assert "layers.sheet.impulses[0]: no node" in refusal(once(LayerMotion(impulses=(impulse,))))
    message = refusal(Motion({"hat": LayerMotion()}))
    assert message == "layers.hat: there is no layer 'hat'; there are: 'sheet'"
    attachment = Attachment(("sheet", "hat"), (80, 75), 9)
    message = refusal(once(LayerMotion(), attachments=(attachment,)))
    assert message == "attachments[0].layers: there is no layer 'hat'; there are: 'sheet'"


def test_a_mesh_without_area_is_refused():
    flat = Body("sheet", np.zeros((3, 2)), np.array([[0, 1, 2]]))
    empty = Body("sheet", np.zeros((3, 2)), np.zeros((0, 3), np.int32))
    for body in (flat, empty):
        assert "layer 'sheet': its mesh has no area" in refusal(
            Motion({"*": LayerMotion()}), [body]
        )


def test_progress_and_interruption():
    calls = []
    motion = once(LayerMotion(), duration=0.25)
    simulate([sheet()], motion, canvas=CANVAS, progress=lambda *a: calls.append(a))
    assert calls == [(i, 6) for i in range(1, 7)]

    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate([sheet()], motion, canvas=CANVAS, progress=stop)
