"""What every description of the truth is built from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeVar, cast, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic.fields import FieldInfo

from rail_msgs_py.quantity import NEEDED, Quantity

LONGEST_TRACK_M: Final = 1e6


def _not_a_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a number is wanted, not a truth value")
    return value


StrictFloat = Annotated[float, BeforeValidator(_not_a_bool)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Chainage = Annotated[StrictFloat, Field(ge=0.0, le=LONGEST_TRACK_M)]
Length = Annotated[StrictFloat, Field(gt=0.0, le=LONGEST_TRACK_M)]
Speed = Annotated[StrictFloat, Field(ge=1.0, le=600.0)]


Value = TypeVar("Value")


@dataclass(frozen=True)
class SchemaUnit:
    """Adds the unit to the JSON schema of a field, and tells which quantity the field is of."""

    quantity: Quantity[Any]

    def __call__(self, schema: dict[str, Any]) -> None:
        """Change the schema of the field."""
        if self.quantity.unit:
            schema["unit"] = self.quantity.unit


def field_of(quantity: Quantity[Value], **more: Any) -> Value:
    """Field of what somebody writes: default, bounds and description are the quantity's.

    The numbers of an array have their bounds by `range_of`.

    Parameters
    ----------
    quantity : Quantity
    **more
        What else `pydantic.Field` takes.
    """
    default = ... if quantity.default is NEEDED else quantity.default
    if not isinstance(default, tuple):
        more |= _bounds(quantity)
    return cast("Value", Field(default, **_meaning(quantity), **more))


def range_of(quantity: Quantity[Any]) -> Any:
    """Annotation of what is always given: bounds and description of the quantity, no default."""
    return Field(**_meaning(quantity), **_bounds(quantity))


def quantity_of_field(field: FieldInfo) -> Quantity[Any] | None:
    """Quantity of a field of a description, or of its elements; None if it declares itself."""
    extra = field.json_schema_extra
    if isinstance(extra, SchemaUnit):
        return extra.quantity
    return _quantity_within(field.annotation)


def _quantity_within(annotation: Any) -> Quantity[Any] | None:
    for part in (*getattr(annotation, "__metadata__", ()), *get_args(annotation)):
        found = quantity_of_field(part) if isinstance(part, FieldInfo) else _quantity_within(part)
        if found is not None:
            return found
    return None


def _meaning(quantity: Quantity[Any]) -> dict[str, Any]:
    return {"description": quantity.description, "json_schema_extra": SchemaUnit(quantity)}


def _bounds(quantity: Quantity[Any]) -> dict[str, Any]:
    low = "gt" if quantity.low_open else "ge"
    bounds = {low: quantity.low, "le": quantity.high}
    return {key: bound for key, bound in bounds.items() if math.isfinite(bound)}


def whole_samples(sample_rate_hz: float, tick_s: float) -> int:
    """Samples in a tick.

    Raises
    ------
    ValueError
        If that is not a whole number above zero.
    """
    exact = sample_rate_hz * tick_s
    count = round(exact)
    if count < 1 or abs(exact - count) > 1e-6:
        raise ValueError(f"tick_s: {tick_s:g} is not a whole number of samples")
    return count


class Description(BaseModel):
    """Base of every description: frozen, no unknown field, no NaN, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
