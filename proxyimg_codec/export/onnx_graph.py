"""Builder of ONNX graphs from formulas: values with operators, and nested graphs."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..errors import UnsupportedError

if TYPE_CHECKING:
    import onnx

OPSET = 18
IR_VERSION = 8

CONSTANTS_MAX = (1 << 31) - (1 << 24)
"""Most bytes of constants: a protobuf message has at most 2 GiB, of which nodes need some."""

Shape = Sequence[int | str]


@dataclass(frozen=True, eq=False)
class Value:
    """Tensor of a graph. Its operators add nodes; numbers beside a value get its dtype."""

    graph: Graph
    name: str
    dtype: np.dtype[Any]

    def __add__(self, other: Operand) -> Value:
        return self.graph.op("Add", self, other)

    __radd__ = __add__

    def __sub__(self, other: Operand) -> Value:
        return self.graph.op("Sub", self, other)

    def __rsub__(self, other: Operand) -> Value:
        return self.graph.op("Sub", other, self)

    def __mul__(self, other: Operand) -> Value:
        return self.graph.op("Mul", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Operand) -> Value:
        return self.graph.op("Div", self, other)

    def __rtruediv__(self, other: Operand) -> Value:
        return self.graph.op("Div", other, self)

    def __lt__(self, other: Any) -> Value:
        return self.graph.op("Less", self, other, dtype=bool)

    def __le__(self, other: Any) -> Value:
        return self.graph.op("LessOrEqual", self, other, dtype=bool)

    def __gt__(self, other: Any) -> Value:
        return self.graph.op("Greater", self, other, dtype=bool)

    def __ge__(self, other: Any) -> Value:
        return self.graph.op("GreaterOrEqual", self, other, dtype=bool)

    def __and__(self, other: Value) -> Value:
        return self.graph.op("And", self, other)

    def maximum(self, other: Operand) -> Value:
        """Element-wise maximum."""
        return self.graph.op("Max", self, other)

    def minimum(self, other: Operand) -> Value:
        """Element-wise minimum."""
        return self.graph.op("Min", self, other)

    def clip(self, low: Operand, high: Operand) -> Value:
        """Element-wise clamp to `low`..`high`."""
        return self.maximum(low).minimum(high)

    def floor(self) -> Value:
        """Element-wise rounding down."""
        return self.graph.op("Floor", self)

    def abs(self) -> Value:
        """Element-wise magnitude."""
        return self.graph.op("Abs", self)

    def astype(self, dtype: DTypeLike) -> Value:
        """Cast to another dtype."""
        kind = self.graph.helper.np_dtype_to_tensor_dtype(np.dtype(dtype))
        return self.graph.op("Cast", self, dtype=dtype, to=kind)

    def take(self, index: int | Value | NDArray[Any], axis: int = 0) -> Value:
        """Items along an axis, by index; a single number removes the axis."""
        if isinstance(index, int):
            index = np.array(index)
        return self.graph.op("Gather", self, index, axis=axis)

    def compressed(self, keep: Value, axis: int) -> Value:
        """Items along an axis for which `keep` is true."""
        return self.graph.op("Compress", self, keep, axis=axis)

    def split(self, parts: int, axis: int) -> list[Value]:
        """Splits an axis of `parts` items into parts of one item each; the axis is kept."""
        outputs = [Value(self.graph, self.graph._name("Split"), self.dtype) for _ in range(parts)]
        shape = {"axis": axis, "num_outputs": parts}
        self.graph._add("Split", [self], self.dtype, outputs, shape)
        return outputs

    def reshape(self, *shape: int) -> Value:
        """Reshapes the tensor; an extent of 0 is kept, one of -1 is computed."""
        return self.graph.op("Reshape", self, np.array(shape, np.int64))

    def reduced(self, how: str, axis: int | None = None) -> Value:
        """Reduces an axis, which is removed, or all axes.

        Args:
            how: ``Sum``, ``Min`` or ``Max``.
            axis: The axis; None for all.
        """
        axes = [] if axis is None else [np.array([axis])]
        return self.graph.op(f"Reduce{how}", self, *axes, keepdims=0)


Operand = Value | NDArray[Any] | float


class Graph:
    """ONNX model that grows node by node.

    Attributes:
        helper: The module `onnx.helper`.

    Raises:
        UnsupportedError: onnx is not installed.
    """

    def __init__(self) -> None:
        try:
            from onnx import helper
        except ImportError:
            raise UnsupportedError("ONNX needs onnx: pip install 'proxyimg-codec[ort]'") from None
        self.helper = helper
        self._nodes: list[list[onnx.NodeProto]] = [[]]  # the last is the innermost graph
        self._inputs: list[onnx.ValueInfoProto] = []
        self._constants: dict[tuple[str, tuple[int, ...], bytes], Value] = {}
        self._arrays: dict[str, NDArray[Any]] = {}
        self._count = 0

    def input(self, name: str, dtype: DTypeLike, shape: Shape) -> Value:
        """Adds an input of the model; names in its shape are dynamic extents."""
        self._inputs.append(self._described(value := Value(self, name, np.dtype(dtype)), shape))
        return value

    def constant(self, array: NDArray[Any]) -> Value:
        """Adds an initializer; equal arrays are stored once."""
        array = np.ascontiguousarray(array).reshape(array.shape)  # a scalar became [1]
        key = array.dtype.str, array.shape, hashlib.sha256(array.data).digest()
        found = self._constants.get(key)
        if found is None:
            found = Value(self, f"constant_{len(self._arrays)}", array.dtype)
            self._constants[key] = found
            self._arrays[found.name] = array
        return found

    def op(
        self,
        kind: str,
        *inputs: Operand,
        dtype: DTypeLike | None = None,
        name: str = "",
        **attributes: Any,
    ) -> Value:
        """Adds a node with one output.

        Args:
            kind: The operator of ONNX.
            *inputs: Values; numbers and arrays become constants.
            dtype: dtype of the output; that of the first `Value` by default.
            name: Name of the output.
            **attributes: Attributes of the node.
        """
        own = next(v.dtype for v in inputs if isinstance(v, Value))
        output = Value(self, name or self._name(kind), np.dtype(dtype) if dtype else own)
        self._add(kind, inputs, own, [output], attributes)
        return output

    def concat(self, values: Sequence[Operand], axis: int) -> Value:
        """Concatenates values along an axis."""
        return self.op("Concat", *values, axis=axis)

    def where(self, condition: Value, yes: Value, no: Value) -> Value:
        """Items of `yes` where the condition holds, otherwise of `no`."""
        return self.op("Where", condition, yes, no, dtype=yes.dtype)

    def choose(self, condition: Value, yes: Callable[[], Value], no: Callable[[], Value]) -> Value:
        """Runs the graph that `yes` builds if the condition holds, otherwise the one of `no`.

        Only the nodes of the chosen graph are computed.

        Args:
            condition: A single bool.
            yes: Function that adds the nodes of one graph and returns its output.
            no: The same for the other graph.
        """
        made, branches = [], {}
        for key, build in (("then_branch", yes), ("else_branch", no)):
            value, branches[key] = self._nested(build)
            made.append(value)
        return self.op("If", condition, dtype=made[0].dtype, **branches)

    def scan(self, values: Value, build: Callable[[Value], Value]) -> Value:
        """Applies the graph that `build` makes to each item along the first axis of `values`.

        Returns:
            The results, stacked along a new first axis.
        """
        item = Value(self, self._name("item"), values.dtype)
        made, body = self._nested(lambda: build(item), [item])
        return self.op("Scan", values, dtype=made.dtype, body=body, num_scan_inputs=1)

    def model(
        self, name: str, outputs: Sequence[tuple[Value, Shape]], documentation: str = "",
        metadata: dict[str, str] | None = None,
    ) -> onnx.ModelProto:  # fmt: skip
        """Finishes the model, and checks it.

        Args:
            name: Name of the graph.
            outputs: Outputs and their shapes.
            documentation: Text for people, stored in the model.
            metadata: Properties stored in the model.

        Raises:
            UnsupportedError: The model would be too large.
        """
        import onnx
        from onnx import numpy_helper

        if sum(v.nbytes for v in self._arrays.values()) > CONSTANTS_MAX:
            raise UnsupportedError(
                "the ONNX model would be larger than 2 GiB, which is more than one file of it can "
                "be; export fewer layers (--layer)"
            )
        (nodes,) = self._nodes
        constants = [numpy_helper.from_array(v, n) for n, v in self._arrays.items()]
        described = [self._described(*output) for output in outputs]
        graph = self.helper.make_graph(
            nodes, name, self._inputs, described, constants, doc_string=documentation
        )
        made = self.helper.make_model(
            graph, opset_imports=[self.helper.make_opsetid("", OPSET)], ir_version=IR_VERSION,
            producer_name="proxyimg-codec", doc_string=documentation,
        )  # fmt: skip
        self.helper.set_model_props(made, metadata or {})
        onnx.checker.check_model(made)
        return made

    def _add(
        self, kind: str, inputs: Sequence[Operand], dtype: np.dtype[Any], outputs: Sequence[Value],
        attributes: dict[str, Any],
    ) -> None:  # fmt: skip
        """Adds a node to the innermost graph."""
        names = []
        for v in inputs:
            if not isinstance(v, Value):
                v = self.constant(v if isinstance(v, np.ndarray) else np.array(v, dtype))
            names.append(v.name)
        into = [v.name for v in outputs]
        self._nodes[-1].append(self.helper.make_node(kind, names, into, name=into[0], **attributes))

    def _nested(
        self, build: Callable[[], Value], inputs: Sequence[Value] = ()
    ) -> tuple[Value, onnx.GraphProto]:
        """Runs `build`; returns its output, and the graph of the nodes that it added."""
        self._nodes.append([])
        made = build()
        # An output must belong to the nested graph itself, not to a graph around it.
        made = self.op("Identity", made)
        given = [self._described(v) for v in inputs]
        name = self._name("graph")
        return made, self.helper.make_graph(self._nodes.pop(), name, given, [self._described(made)])

    def _described(self, value: Value, shape: Shape | None = None) -> onnx.ValueInfoProto:
        kind = self.helper.np_dtype_to_tensor_dtype(value.dtype)
        return self.helper.make_tensor_value_info(value.name, kind, shape)

    def _name(self, kind: str) -> str:
        self._count += 1
        return f"{kind}_{self._count}"
