"""An ONNX graph under construction: methods accept numbers and names, and return the name of the result."""

from collections.abc import Iterable, Sequence
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from onnx import GraphProto, NodeProto, ValueInfoProto

#: a value by its name, or as numbers
Value = str | float | NDArray[Any]
#: lowest versions that have all operators in this form (runtimes since 2021)
OPSET, IR = 13, 7
#: types of elements in `onnx.TensorProto`, without importing onnx
DOUBLE, INT64, BOOL = 11, 7, 9


class Graph:
    """Operators in order.

    Parameters
    ----------
    outer : Graph, optional
        Enclosing graph, whose values are visible.
    """

    def __init__(self, outer: "Graph | None" = None) -> None:
        from onnx import helper

        self._onnx = helper
        self._nodes: list[NodeProto] = []
        self._inputs: list[ValueInfoProto] = []
        self._outputs: list[ValueInfoProto] = []
        self._constants: dict[object, tuple[str, NDArray[Any]]] = outer._constants if outer else {}
        self._free: count[int] = outer._free if outer else count()

    def name(self) -> str:
        """Return an unused name."""
        return f"v{next(self._free)}"

    def enter(self, name: str, shape: Sequence[int] = (1,), kind: int = DOUBLE, about: str = "") -> str:
        """Return the name of a new input."""
        self._inputs.append(self._onnx.make_tensor_value_info(name, kind, shape, about))
        return name

    def leave(self, name: str, value: str, shape: Sequence[int] = (1,), kind: int = DOUBLE, about: str = "") -> None:
        """Add an output with a given name and value."""
        self._nodes.append(self._onnx.make_node("Identity", [value], [name]))
        self._outputs.append(self._onnx.make_tensor_value_info(name, kind, shape, about))

    def constant(self, numbers: Value) -> str:
        """Return the name of a numeric constant; a scalar becomes a vector of one element."""
        if isinstance(numbers, str):
            return numbers
        table = np.atleast_1d(numbers)
        key = (table.dtype.str, table.shape, table.tobytes())
        return self._constants.setdefault(key, (f"c{len(self._constants)}", table))[0]

    def put(self, op: str, *inputs: Value, **attributes: Any) -> str:
        """Return the name of an operator's output."""
        found = self.name()
        self._nodes.append(self._onnx.make_node(op, [self.constant(i) for i in inputs], [found], **attributes))
        return found

    def add(self, *terms: Value) -> str:
        """Return a sum, evaluated from left to right."""
        return self.put("Sum", *terms) if len(terms) > 1 else self.constant(terms[0])

    def choose(self, when: Value, this: Value, other: Value) -> str:
        """Return one of two values, element by element."""
        return self.put("Where", when, this, other)

    def between(self, value: Value, low: Value, high: Value) -> str:
        """Return a value clipped to two bounds."""
        return self.put("Min", self.put("Max", value, low), high)

    def every(self, *conditions: str) -> str:
        """Return whether all conditions are true."""
        held = [self.put("Cast", c, to=INT64) for c in conditions]
        return self.put("Greater", self.put("ReduceMin", self.join([*held, np.array([1])]), keepdims=1), np.array([0]))

    def pick(self, of: Value, places: Iterable[int]) -> str:
        """Return elements of a vector by index."""
        return self.put("Gather", of, np.array([*places], dtype=np.int64), axis=0)

    def join(self, parts: Sequence[Value]) -> str:
        """Return the concatenation of vectors."""
        return self.put("Concat", *parts, axis=0) if len(parts) > 1 else self.constant(parts[0])

    def proto(self, name: str) -> "GraphProto":
        """Return the graph as an ONNX proto; constants belong to the outermost graph."""
        return self._onnx.make_graph(self._nodes, name, self._inputs, self._outputs)

    def serialize(self, name: str, facts: Sequence[str], properties: dict[str, str], version: str) -> bytes:
        """Return the contents of the file of this graph."""
        from onnx import checker, numpy_helper

        proto = self.proto(name)
        proto.initializer.extend(numpy_helper.from_array(table, name) for name, table in self._constants.values())
        opsets, text = [self._onnx.make_opsetid("", OPSET)], "\n".join(facts)
        model = self._onnx.make_model(proto, opset_imports=opsets, ir_version=IR, doc_string=text)
        model.producer_name, model.producer_version = "thermocomp", version
        self._onnx.set_model_props(model, properties)
        checker.check_model(model, full_check=True)
        return bytes(model.SerializeToString(deterministic=True))
