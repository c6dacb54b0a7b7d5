import numpy as np
import pytest

from proxyimg_codec.errors import LimitError, UsageError
from proxyimg_codec.render.view import make_view


@pytest.mark.parametrize(
    ("request_", "size"),
    [
        ({}, (90, 60)),
        ({"width": 45}, (45, 30)),
        ({"height": 120}, (180, 120)),
        ({"width": 10, "height": 10}, (10, 10)),
        ({"scale": 0.001}, (1, 1)),
        ({"scale": 2.5}, (225, 150)),
        ({"region": (10, 20, 30, 5), "scale": 2}, (60, 10)),
    ],
)
def test_size_follows_from_the_request(request_, size):
    view = make_view((90, 60), **request_)
    assert (view.width, view.height) == size


@pytest.mark.parametrize(
    "request_",
    [
        {"scale": 0}, {"scale": -1}, {"scale": float("nan")}, {"scale": float("inf")},
        {"width": 0}, {"height": -3}, {"scale": 1, "width": 5}, {"region": (0, 0, 0, 5)},
        {"region": (-1, 0, 5, 5)}, {"region": (0, 0, 91, 5)},
    ],
)  # fmt: skip
def test_senseless_requests_are_refused(request_):
    with pytest.raises(UsageError):
        make_view((90, 60), **request_)


@pytest.mark.parametrize("request_", [{"scale": 1e308}, {"width": 10**400}, {"height": 1 << 25}])
def test_absurd_sizes_are_refused(request_):
    with pytest.raises(LimitError):
        make_view((90, 60), **request_)


def test_samples_sit_at_pixel_centres():
    view = make_view((90, 60))
    assert view.supersampling == (1, 1)
    assert np.allclose(view.columns(0, 90), np.arange(90) + 0.5)
    half = make_view((90, 60), scale=0.4)
    assert half.supersampling == (3, 3)
    assert np.allclose(half.columns(0, 6), (np.arange(6) + 0.5) * 90 / 108)
