from dataclasses import replace

import pytest

from proxyimg_codec import from_bytes
from proxyimg_codec.container.check import check
from proxyimg_codec.container.file import parse, serialize
from proxyimg_codec.errors import FormatError
from proxyimg_codec.limits import Budget


@pytest.fixture(scope="module")
def container(small_pxi):
    """Three layers: back, bar and disc."""
    return parse(small_pxi.read_bytes())


def with_tree(container, groups, parents):
    return replace(container, tree={"groups": groups, "parents": parents})


def test_a_tree_comes_back(container):
    # Numbers 1 to 3 are the layers, 4 and 5 the groups.
    data = serialize(with_tree(container, ["pair", "all"], [5, 4, 2, 5, 0]))
    image = from_bytes(data)
    assert [layer.parent for layer in image.layers] == ["all", "pair", "bar"]
    assert dict(image.groups) == {"pair": "all", "all": None}
    assert image.to_bytes() == data


@pytest.mark.parametrize(
    ("groups", "parents", "said"),
    [
        ([], [0, 0], "do not fit"),
        ([], [0, 0, 0, 0], "do not fit"),
        (["a"], [0, 0, 0], "do not fit"),
        (["a"], [0, 0, 5, 0], "do not fit"),
        (["a", "a"], [0] * 5, "name of another"),
        (["disc"], [0] * 4, "name of another"),
        ([], [1, 0, 0], "part of itself"),
        ([], [0, 3, 2], "part of itself"),
        (["a", "b"], [0, 0, 4, 5, 4], "part of itself"),
    ],
)
def test_what_is_no_tree_is_refused(container, groups, parents, said):
    with pytest.raises(FormatError, match=said):
        parse(serialize(with_tree(container, groups, parents)))


def test_deep_trees_are_checked(container):
    count = 1 << 17
    groups = [str(i) for i in range(count - 3)]
    deep = with_tree(container, groups, [*range(2, count + 1), 0])
    # Walking up to the root from each node would take hours.
    check(deep, Budget())
    with pytest.raises(FormatError, match="part of itself"):
        check(with_tree(container, groups, [*range(2, count + 1), 1]), Budget())
