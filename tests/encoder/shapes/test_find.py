"""Layers by a segmenter or by pointing, and what is refused."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

import proxyimg_codec as pxi
from tests.support.maps import HOUSE, TREE, house

pytestmark = pytest.mark.usefixtures("plain_maps")


def names(regions):
    return [r.name for r in regions]


def test_what_nobody_named_is_the_back_and_small_things_are_in_front():
    regions = pxi.find_layers(house(), points={"window": [(40, 52)], "tree": [(100, 50)]})
    assert names(regions) == ["back", "tree", "window"]
    assert (sum(r.mask.astype(int) for r in regions) == 1).all()
    image = pxi.encode(house(), masks=regions, effort=1, jobs=1)
    assert [v.name for v in image.layers] == names(regions)


def test_nothing_pointed_at_is_left_to_the_segmenter():
    assert names(pxi.find_layers(house(), max_layers=1)) == ["picture"]
    regions = pxi.find_layers(house(), segmenter="regions", max_layers=3)
    assert 2 <= len(regions) <= 3
    assert regions[0].name == "back"


def test_points_in_the_back_are_outside_of_all():
    points = {"house": [(22, 80)], "back": [(40, 52)]}
    assert not pxi.find_layers(house(), points=points)[1].mask[50:57, 34:45].any()


def test_scribbles_name_objects_by_their_labels():
    strokes = np.zeros(TREE.shape, np.uint8)
    strokes[40:60, 98:102], strokes[78:82, 20:40] = 1, 3
    regions = pxi.find_layers(house(), scribbles=strokes)
    assert sorted(names(regions)) == ["back", "object 1", "object 3"]
    mask = next(r.mask for r in regions if r.name == "object 1")
    assert (mask & TREE).sum() / (mask | TREE).sum() > 0.9


def test_masks_stay_and_one_is_refined():
    masks = {"house": HOUSE, "tree": np.roll(TREE, (3, -3), (0, 1))}
    regions = pxi.find_layers(house(), masks=masks, refine=["tree"])
    assert names(regions) == ["back", "house", "tree"]
    assert (regions[1].mask == HOUSE).all()
    assert (regions[2].mask & TREE).sum() / (regions[2].mask | TREE).sum() > 0.93
    more = pxi.find_layers(house(), masks={"house": HOUSE}, points={"tree": [(100, 50)]})
    assert names(more) == ["back", "house", "tree"]


def test_prompters_are_found_by_name(monkeypatch):
    entry = EntryPoint("corner", f"{__name__}:corner", "proxyimg_codec.prompters")
    monkeypatch.setattr(
        "importlib.metadata.entry_points",
        lambda group: [entry] if group == entry.group else [],
    )
    regions = pxi.find_layers(house(), points={"a": [(100, 50)]}, prompter="corner")
    assert regions[1].mask.sum() == 9


def corner(rgb, prompts, jobs=1):
    """A prompter from elsewhere."""
    mask = np.zeros(rgb.shape[:2], bool)
    mask[:3, :3] = True
    return [pxi.Region(p.name, mask) for p in prompts]


def test_transparent_pictures_have_layers_where_they_are_seen():
    alpha = np.where(HOUSE | TREE, 255, 0).astype(np.uint8)
    regions = pxi.find_layers(np.dstack([house(), alpha]), points={"tree": [(100, 50)]})
    assert names(regions) == ["rest", "tree"]
    assert not (regions[0].mask & ~HOUSE & ~TREE).any()


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"points": {"a": [(131, 5)]}}, pxi.InputError, "131,5"),
        ({"points": {"back": [(131, 5)]}}, pxi.InputError, "131,5"),
        ({"points": {"a": [(5, 5)]}, "negatives": {"a": [(5, 5)]}}, pxi.InputError, "inside and"),
        ({"points": {"a": [(5, 5)], "back": [(5, 5)]}}, pxi.InputError, "inside and"),
        ({"negatives": {"a": [(5, 5)]}}, pxi.InputError, "nothing is said to be inside"),
        ({"boxes": {"back": (1, 1, 5, 5)}}, pxi.UsageError, "only points"),
        ({"refine": ["a"]}, pxi.UsageError, "no mask 'a'"),
        ({"points": {"a": [(5, 5)]}, "max_layers": 3}, pxi.UsageError, "no use"),
        ({"points": {"a": [(5, 5)]}, "prompter": "magic"}, pxi.UsageError, "maps"),
        ({"prompter": "maps"}, pxi.UsageError, "prompter is of no use without points"),
        ({"segmenter": "magic"}, pxi.UsageError, "regions"),
        ({"scribbles": np.zeros((3, 3), np.uint8)}, pxi.InputError, "3x3"),
    ],
)
def test_what_contradicts_is_refused(options, error, message):
    with pytest.raises(error, match=message):
        pxi.find_layers(house(), **options)
