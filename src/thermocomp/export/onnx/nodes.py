"""An ONNX graph under construction: methods accept numbers and names, and return the name of the result."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from onnx import GraphProto, NodeProto, ValueInfoProto

#: a value by its name, or as numbers
Value = str | float | Sequence[float] | NDArray[Any]
#: versions supported by runtimes since 2022
OPSET, IR = 17, 8


@dataclass(frozen=True)
class Port:
    """Input or output of a graph.

    Parameters
    ----------
    shape : tuple of int
    kind : type
        Type of the elements.
    """

    name: str
    shape: tuple[int, ...]
    kind: type = np.float64


@dataclass(frozen=True)
class Node:
    """One operator.

    Parameters
    ----------
    attributes : dict of str to Any
        A `Graph` among them becomes a subgraph.
    """

    op: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    attributes: dict[str, Any]


class Graph:
    """Operators in order; identical ones are computed once.

    Parameters
    ----------
    outer : Graph, optional
        Enclosing graph, whose values are visible.
    """

    def __init__(self, outer: "Graph | None" = None) -> None:
        self.nodes: list[Node] = []
        self.inputs: list[Port] = []
        self.outputs: list[Port] = []
        self.constants: dict[str, NDArray[Any]] = outer.constants if outer else {}
        self._numbers: dict[object, str] = outer._numbers if outer else {}
        self._free: Iterator[int] = outer._free if outer else count()
        self._known: dict[object, str] = dict(outer._known) if outer else {}

    def name(self) -> str:
        """Return a name that is not yet used in the graph."""
        return f"v{next(self._free)}"

    def enter(self, name: str, shape: tuple[int, ...] = (1,), kind: type = np.float64) -> str:
        """Add an input to the graph and return its name."""
        self.inputs.append(Port(name, shape, kind))
        return name

    def leave(self, name: str, value: str, shape: tuple[int, ...] = (1,), kind: type = np.float64) -> None:
        """Add an output with a given name and value.

        Parameters
        ----------
        shape : tuple of int
        """
        self.nodes.append(Node("Identity", (value,), (name,), {}))
        self.outputs.append(Port(name, shape, kind))

    def constant(self, numbers: Value) -> str:
        """Return the name of a numeric constant; a scalar becomes a vector of one element."""
        if isinstance(numbers, str):
            return numbers
        table = np.atleast_1d(numbers)
        table = table.astype(np.float64) if table.dtype.kind == "f" else table
        key = (table.dtype.str, table.shape, table.tobytes())
        if (name := self._numbers.get(key)) is None:
            name = self._numbers[key] = f"c{len(self._numbers)}"
            self.constants[name] = table
        return name

    def put(self, op: str, *inputs: Value, **attributes: Any) -> str:
        """Add an operator and return the name of its output."""
        names = tuple(map(self.constant, inputs))
        key = (op, names, repr(sorted(attributes.items())))
        if (known := self._known.get(key)) is None:
            known = self._known[key] = self.name()
            self.nodes.append(Node(op, names, (known,), attributes))
        return known

    def add(self, *terms: Value) -> str:
        """Return the name of a sum, evaluated from left to right."""
        return self.put("Sum", *terms) if len(terms) > 1 else self.constant(terms[0])

    def choose(self, when: Value, this: Value, other: Value) -> str:
        """Return the name of a value selected from two, element by element, by a condition."""
        return self.put("Where", when, this, other)

    def between(self, value: Value, low: Value, high: Value) -> str:
        """Return the name of a value clipped to a lower and an upper bound."""
        return self.put("Min", self.put("Max", value, low), high)

    def every(self, conditions: str) -> str:
        """Return the name of a condition: all given conditions are true."""
        held = self.put("ReduceMin", self.put("Cast", conditions, to=_kind(np.int64)), keepdims=1)
        return self.put("Greater", held, 0)

    def pick(self, of: Value, places: int | Sequence[int]) -> str:
        """Return the name of a vector of selected elements of a vector."""
        return self.put("Gather", of, np.array(np.atleast_1d(places), dtype=np.int64), axis=0)

    def join(self, parts: Sequence[Value]) -> str:
        """Return the name of the concatenation of vectors."""
        return self.put("Concat", *parts, axis=0) if len(parts) > 1 else self.constant(parts[0])

    def part(self, of: str, begin: int, end: int) -> str:
        """Return the name of a contiguous part of a vector."""
        return self.put("Slice", of, np.array([begin]), np.array([end]))

    def loop(self, trips: str, carried: Sequence[str], body: "Graph") -> list[str]:
        """Return the names of the final values of variables that a loop body updates."""
        left = tuple(self.name() for _ in carried)
        self.nodes.append(Node("Loop", (trips, "", *carried), left, {"body": body}))
        return list(left)

    def proto(self, name: str) -> "GraphProto":
        """Return the graph as an ONNX proto; constants are in the outermost graph."""
        from onnx import helper

        return helper.make_graph(
            [_node(n) for n in self.nodes], name, [_port(p) for p in self.inputs], [_port(p) for p in self.outputs]
        )


def serialize(graph: Graph, name: str, facts: Sequence[str], properties: dict[str, str], version: str) -> bytes:
    """Return the graph as the contents of an ONNX file."""
    from onnx import checker, helper, numpy_helper

    proto = graph.proto(name)
    proto.initializer.extend(numpy_helper.from_array(v, k) for k, v in graph.constants.items())
    proto.doc_string = "\n".join(facts)
    model = helper.make_model(
        proto,
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR,
        producer_name="thermocomp",
        producer_version=version,
        doc_string="\n".join(facts),
    )
    helper.set_model_props(model, properties)
    checker.check_model(model, full_check=True)
    return bytes(model.SerializeToString(deterministic=True))


def _kind(kind: type) -> int:
    from onnx import TensorProto

    kinds = {np.float64: TensorProto.DOUBLE, np.int64: TensorProto.INT64, np.bool_: TensorProto.BOOL}
    return int(kinds[kind])


def _node(node: Node) -> "NodeProto":
    from onnx import helper

    attributes = {k: v.proto("body") if isinstance(v, Graph) else v for k, v in node.attributes.items()}
    return helper.make_node(node.op, node.inputs, node.outputs, **attributes)


def _port(port: Port) -> "ValueInfoProto":
    from onnx import helper

    return helper.make_tensor_value_info(port.name, _kind(port.kind), list(port.shape))
