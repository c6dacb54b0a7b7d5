import numpy as np

from proxyimg_codec.encoder.shapes.basins import merged_basins
from proxyimg_codec.encoder.shapes.figure_parts import regions_of_figure

HEIGHT, WIDTH = 117, 181
LEFT, RIGHT, SPECK, LINE = (
    np.s_[20:80, 15:70], np.s_[30:100, 100:160], np.s_[4:9, 80:85], np.s_[50:52, 60:110],
)  # fmt: skip


def scene(*parts):
    """A picture and its figure map, with these parts in it."""
    rgb = np.full((HEIGHT, WIDTH, 3), (60, 120, 60), np.uint8)
    figure = np.zeros((HEIGHT, WIDTH), np.float32)
    for part in parts:
        rgb[part] = 220, 60, 40
        figure[part] = 0.9
    return rgb, figure


def share(regions, part):
    truth = np.zeros((HEIGHT, WIDTH), bool)
    truth[part] = True
    return max((r.mask & truth).sum() / (r.mask | truth).sum() for r in regions)


def test_parts_are_apart_bridges_are_cut_and_specks_dropped():
    regions = regions_of_figure(*scene(LEFT, RIGHT, SPECK, LINE), 5)
    assert regions[0].name == "back"
    assert len(regions) == 3
    assert (np.sum([r.mask for r in regions], 0) == 1).all()
    assert share(regions[1:], LEFT) > 0.95
    assert share(regions[1:], RIGHT) > 0.95


def test_the_largest_are_kept():
    rgb, figure = scene(LEFT, RIGHT)
    two = regions_of_figure(rgb, figure, 2)
    assert len(two) == 2
    assert share(two[1:], RIGHT) > 0.95
    (whole,) = regions_of_figure(rgb, figure, 1)
    assert whole.mask.all()


def test_slender_things_alone_are_found():
    bar = np.s_[40:44, 10:170]
    regions = regions_of_figure(*scene(bar), 4)
    assert len(regions) == 2
    assert regions[1].mask[40:44, 30:150].mean() > 0.5


def test_nothing_that_stands_out_is_one_region():
    for figure in (0.0, 1.0):
        rgb, empty = scene()
        (region,) = regions_of_figure(rgb, empty + np.float32(figure), 4)
        assert region.name == "back"
        assert region.mask.all()


def test_support_bounds_regions():
    support = np.zeros((HEIGHT, WIDTH), bool)
    support[10:90, 5:120] = True
    regions = regions_of_figure(*scene(LEFT, RIGHT), 4, support)
    assert (np.sum([r.mask for r in regions], 0) == support).all()
    assert share(regions, LEFT) > 0.95
    assert "back" not in [r.name for r in regions]
    assert regions_of_figure(*scene(LEFT), 4, support & False) == []


def edges(*columns):
    boundary = np.zeros((HEIGHT, WIDTH), np.float32)
    for x, strength in columns:
        boundary[:, x - 1 : x + 1] = strength
    return boundary


def test_strong_boundaries_of_the_ground_make_layers_of_what_is_left():
    rgb, figure = scene(LEFT)
    rgb[:, 120:] = 40, 60, 220
    boundary = edges((120, 0.8), (150, 0.1))
    regions = regions_of_figure(rgb, figure, 4, None, boundary)
    assert len(regions) == 3
    assert share(regions[1:], np.s_[:, 120:]) > 0.95
    assert len(regions_of_figure(rgb, figure, 2, None, boundary)) == 2
    assert len(regions_of_figure(rgb, figure, 4)) == 2


def test_basins_merge_across_weak_boundaries_only():
    inside = np.ones((HEIGHT, WIDTH), bool)
    inside[:, 170:] = False
    labels = merged_basins(edges((60, 0.7), (120, 0.1)), inside, 0.16)
    assert (labels[:, 170:] == -1).all()
    assert len(np.unique(labels[:, :170])) == 2
    assert len({*labels[:, 5], *labels[:, 100]}) == 2
    assert (labels[:, 100] == labels[:, 150]).all()
    assert (merged_basins(edges(), inside, 0.16)[inside] == 0).all()
