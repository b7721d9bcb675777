"""Quantities: what a value may be, and what is made of a declaration."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, Any

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from rail_msgs_py.parameters import descriptor, parameter
from rail_msgs_py.quantity import NEEDED, Quantity, quantity_of
from rail_world.line.description_base import StrictFloat, field_of, quantity_of_field, range_of

SPEED = Quantity(36.0, "speed", unit="km/h", low=0.0, high=360.0)
LEVEL = Quantity(4.0, "level", unit="V", low=0.0, high=100.0, low_open=True)
COUNT = Quantity(3, "channels", low=2, high=8)
LAW = Quantity("linear", "law of growth", choices=("linear", "exponential"))
SPEEDS = SPEED.array("speeds")
PLACE = Quantity(NEEDED, "place", unit="m", low=0.0, high=1e4)

CASES = [
    (SPEED, 0.0, True),
    (SPEED, 360.0, True),
    (SPEED, -1e-9, False),
    (SPEED, 360.1, False),
    (SPEED, math.nan, False),
    (SPEED, math.inf, False),
    (LEVEL, 1e-12, True),
    (LEVEL, 0.0, False),
    (COUNT, 2, True),
    (COUNT, 9, False),
    (LAW, "exponential", True),
    (LAW, "cubic", False),
    (SPEEDS, (0.0, 360.0), True),
    (SPEEDS, (0.0, 361.0), False),
    (SPEEDS, (), True),
    (SPEEDS, (math.nan, 1.0), False),
    (LEVEL, (1e-12, 100.0), True),
    (LEVEL, (1.0, 0.0), False),
    (COUNT, (2, 9), False),
    (LAW, ("linear", "cubic"), False),
]


@pytest.mark.parametrize(("quantity", "value", "possible"), CASES)
def test_a_value_is_within_the_bounds_or_refused(
    quantity: Quantity[Any], value: Any, possible: bool
) -> None:
    assert (quantity.refusal(value) == "") == possible


@pytest.mark.parametrize(
    ("quantity", "value", "possible"), [case for case in CASES if not case[0].choices]
)
def test_a_description_draws_the_same_line(
    quantity: Quantity[Any], value: Any, possible: bool
) -> None:
    kind = tuple[Annotated[StrictFloat, range_of(quantity)], ...]
    adapter: TypeAdapter[Any] = TypeAdapter(kind)
    values = value if isinstance(value, tuple) else (value,)
    if possible:
        assert adapter.validate_python(values) == values
    else:
        with pytest.raises(ValidationError):
            adapter.validate_python(values)


def test_a_refusal_names_value_and_bounds() -> None:
    assert SPEED.refusal(400.0) == "400.0 is not within [0.0, 360.0] km/h"
    assert LEVEL.refusal(0.0) == "0.0 is not within (0.0, 100.0] V"
    assert LAW.refusal("cubic") == "cubic is not one of linear, exponential"


def test_a_derived_quantity_follows_its_source() -> None:
    mps = SPEED.derived(lambda kmh: kmh / 3.6, "speed", unit="m/s")
    assert (mps.default, mps.low, mps.high, mps.unit) == (10.0, 0.0, 100.0, "m/s")
    loss = SPEED.derived(lambda kmh: -kmh, "loss of speed")
    assert (loss.default, loss.low, loss.high, loss.unit) == (-36.0, -360.0, 0.0, "km/h")
    assert mps.but(text="fastest").origin is mps.origin is SPEED
    assert SPEED.but().origin is SPEED and SPEED.but() is not SPEED
    assert Quantity(36.0, "speed", unit="km/h", low=0.0, high=360.0) != SPEED


def test_a_field_of_a_section_has_default_bounds_and_description() -> None:
    class Section(BaseModel):
        speed_kmh: StrictFloat = field_of(SPEED)
        speeds_kmh: tuple[Annotated[StrictFloat, range_of(SPEEDS)], ...] = field_of(SPEEDS)
        place_m: StrictFloat = field_of(PLACE)
        other_m: Annotated[StrictFloat, range_of(PLACE)] | None = None

    section = Section(place_m=3.0)
    assert (section.speed_kmh, section.speeds_kmh, section.other_m) == (36.0, (36.0,), None)
    fields = Section.model_fields
    assert fields["speed_kmh"].description == "speed [km/h]"
    assert fields["place_m"].is_required()
    found = [quantity_of_field(field) for field in fields.values()]
    assert found == [SPEED, SPEEDS, PLACE, PLACE]
    for wrong in ({}, {"place_m": -1.0}, {"place_m": 0.0, "speeds_kmh": (361.0,)}):
        with pytest.raises(ValidationError):
            Section(**wrong)
    assert Section.model_json_schema()["properties"]["speed_kmh"]["unit"] == "km/h"


def test_what_is_always_given_has_no_default() -> None:
    class Given(BaseModel):
        level_v: Annotated[StrictFloat, range_of(LEVEL)]
        alone: float = 1.0

    with pytest.raises(ValidationError, match="Field required"):
        Given()  # type: ignore[call-arg]
    assert quantity_of_field(Given.model_fields["alone"]) is None


def test_a_node_parameter_has_default_bounds_and_description() -> None:
    @dataclasses.dataclass(frozen=True)
    class Parameters:
        speed_kmh: float = SPEED.parameter()
        law: str = LAW.parameter()
        own: int = parameter(1, "known here only", low=0, high=5)

    speed, law, own = dataclasses.fields(Parameters)
    assert quantity_of(speed) is SPEED
    assert Parameters() == Parameters(36.0, "linear", 1)
    described = descriptor(speed, float)
    assert described.description == "speed [km/h]"
    assert described.floating_point_range[0].to_value == 360.0
    assert descriptor(law, str).additional_constraints == "one of linear, exponential"
    assert descriptor(own, int).integer_range[0].to_value == 5
