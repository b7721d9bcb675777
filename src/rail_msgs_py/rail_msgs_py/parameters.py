"""Node parameters as frozen dataclasses: described, bounded, declared once.

A node's parameters are the fields of one dataclass, each of a `Quantity`. The same fields declare
the ROS parameters, validate their values and fill ``docs/topics.md``.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, TypeVar, get_type_hints

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter

from .quantity import Quantity, quantity_of

Parameters = TypeVar("Parameters")

_ARRAYS = {
    tuple[float, ...]: Parameter.Type.DOUBLE_ARRAY,
    tuple[int, ...]: Parameter.Type.INTEGER_ARRAY,
    tuple[str, ...]: Parameter.Type.STRING_ARRAY,
}


class ParameterError(ValueError):
    """A parameter has a value that the node cannot work with; one line says which."""


def parameter(
    default: Any, text: str, *, unit: str = "", low: float = -math.inf, high: float = math.inf
) -> Any:
    """Field of a parameter dataclass for what only this node knows.

    What a scenario sets is a `Quantity` that the section refers to as well; its field is
    `Quantity.parameter`.

    Parameters
    ----------
    default : bool, int, float, str or tuple
        Default value.
    text, unit : str
        What it is, and in what unit.
    low, high : float
        Inclusive bounds of a number, and of each number of an array.
    """
    return Quantity(default, text, unit, low, high).parameter()


def declare(node: Any, kind: type[Parameters]) -> Parameters:
    """Declare every field of ``kind`` on ``node`` and return the values in force.

    Raises
    ------
    ParameterError
        If a value has the wrong type or is out of bounds.
    """
    hints = get_type_hints(kind)
    values = {}
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        hint = hints[field.name]
        try:
            values[field.name] = _declare_field(node, field, hint)
        except (ParameterException, ValueError, TypeError) as error:
            reason = str(error).splitlines()[0]
            raise ParameterError(f"{node.get_name()}: {field.name}: {reason}") from None
    return kind(**values)


def _declare_field(node: Any, field: dataclasses.Field[Any], hint: Any) -> Any:
    described = descriptor(field, hint)
    default: Any = field.default
    if hint in _ARRAYS:
        value = node.declare_parameter(field.name, _ARRAYS[hint], described).value
        # An array parameter that nobody sets has no value: there is no typed empty default.
        value = tuple(default if value is None else value)
    else:
        # ROS takes no 5 for a 5.0, as people write it.
        described.dynamic_typing = hint is float
        value = node.declare_parameter(field.name, hint(default), described).value
        if hint is float:
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise TypeError(f"{value!r}: must be a number")
            value = float(value)
    if refused := quantity_of(field).refusal(value):
        raise ValueError(refused)
    return value


def descriptor(field: dataclasses.Field[Any], hint: Any) -> ParameterDescriptor:
    """ROS descriptor of a field: text with unit, bounds, read-only once the node is up."""
    quantity = quantity_of(field)
    described = ParameterDescriptor(description=quantity.description, read_only=True)
    if quantity.choices:
        described.additional_constraints = f"one of {', '.join(map(str, quantity.choices))}"
    low, high = quantity.low, quantity.high
    if hint is float and math.isfinite(low) and math.isfinite(high):
        described.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif hint is int and math.isfinite(low) and math.isfinite(high):
        described.integer_range = [IntegerRange(from_value=int(low), to_value=int(high), step=1)]
    return described


def overrides(values: dict[str, Any]) -> list[Parameter]:
    """Parameter overrides for a node made in this process."""
    overridden = []
    for name, value in values.items():
        if isinstance(value, tuple):
            value = list(value)
        if value != []:
            overridden.append(Parameter(name, value=value))
    return overridden
