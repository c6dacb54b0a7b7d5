"""tREE: groups and parents of layers. This is authoring data: rendering does not depend on it."""

from .fields import Field

TYPE = "tREE"

FIELDS = (
    Field("groups", "strs", "Names of groups, 1..255 characters; no layer has such a name.",
          1, 255),
    Field("parents", "ints",
          "For each layer, then each group: 0 = none, n = layer n - 1, or group n - 1 - layers.",
          0, 1 << 17),
)  # fmt: skip
