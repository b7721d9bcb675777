"""Parameters: declared once, described, bounded; a wrong value is one line."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.parameter import Parameter

from rail_msgs_py.parameters import ParameterError, declare, descriptor, overrides, parameter


@dataclasses.dataclass(frozen=True)
class Example:
    """One parameter of every type."""

    power_dbm: float = parameter(-10.0, "transmit power", unit="dBm", low=-100.0, high=60.0)
    gain: float = parameter(1.0, "gain", low=0.0)
    samples: int = parameter(960, "samples of one burst", low=8, high=31250)
    name: str = parameter("wrs1", "name of the station")
    active: bool = parameter(True, "whether it is on")
    zones: tuple[str, ...] = parameter((), "zones")
    channels: tuple[int, ...] = parameter((1, 3), "channels", low=1)
    tones_hz: tuple[float, ...] = parameter((375e3,), "tones", unit="Hz", low=1.0)


class FakeNode:
    """What ``declare`` needs of a node: rclpy's rules for types, without a graph."""

    def __init__(self, **values: Any) -> None:
        self._values = {p.name: p for p in overrides(values)}
        self.described: dict[str, ParameterDescriptor] = {}

    def get_name(self) -> str:
        return "wrs1"

    def declare_parameter(self, name: str, value: Any, described: ParameterDescriptor) -> Any:
        self.described[name] = described
        if isinstance(value, Parameter.Type):
            kind, default = value, Parameter(name)
        else:
            default = Parameter(name, value=value)
            kind = default.type_
        chosen = self._values.get(name, default)
        free = (kind, Parameter.Type.NOT_SET)
        if not described.dynamic_typing and chosen.type_ not in free:
            raise InvalidParameterTypeException(chosen, kind.name)
        return chosen


def test_defaults_are_those_of_the_dataclass() -> None:
    assert declare(FakeNode(), Example) == Example()


def test_a_whole_number_is_a_decimal_too_and_nothing_else_is() -> None:
    power_dbm = declare(FakeNode(power_dbm=5), Example).power_dbm
    assert power_dbm == 5.0 and isinstance(power_dbm, float)
    for wrong in ("5", True):
        with pytest.raises(ParameterError, match=rf"wrs1: power_dbm: {wrong!r}: must be a number"):
            declare(FakeNode(power_dbm=wrong), Example)
    with pytest.raises(ParameterError, match="wrs1: samples: "):
        declare(FakeNode(samples=960.0), Example)


def test_values_in_force_are_typed_and_complete() -> None:
    node = FakeNode(power_dbm=3.0, zones=("z1", "z2"), channels=(5,), active=False)
    values = declare(node, Example)
    assert values == Example(power_dbm=3.0, zones=("z1", "z2"), channels=(5,), active=False)
    assert isinstance(values.tones_hz, tuple)


@pytest.mark.parametrize(
    "value",
    [
        {"power_dbm": 60.5},
        {"power_dbm": -math.inf},
        {"power_dbm": math.nan},
        {"gain": -1e-9},
        {"gain": math.nan},
        {"samples": 7},
        {"samples": 31251},
        {"channels": (1, 0)},
        {"tones_hz": (375e3, math.nan)},
        {"tones_hz": (0.5,)},
        {"power_dbm": "loud"},
        {"samples": 960.0},
        {"name": 5},
        {"active": 1},
        {"channels": (1.0, 2.0)},
        {"tones_hz": ("a",)},
        {"zones": "z1"},
    ],
)
def test_a_wrong_value_is_one_line_that_names_node_and_field(value: dict[str, Any]) -> None:
    with pytest.raises(ParameterError) as caught:
        declare(FakeNode(**value), Example)
    line = str(caught.value)
    assert line.startswith(f"wrs1: {next(iter(value))}: ")
    assert "\n" not in line


@pytest.mark.parametrize(
    "value", [{"power_dbm": 60.0}, {"power_dbm": -100.0}, {"gain": 0.0}, {"samples": 8}]
)
def test_bounds_are_inclusive(value: dict[str, Any]) -> None:
    assert dataclasses.asdict(declare(FakeNode(**value), Example)).items() >= value.items()


def test_descriptors_carry_text_unit_and_bounds() -> None:
    node = FakeNode()
    declare(node, Example)
    power, samples, gain = (node.described[name] for name in ("power_dbm", "samples", "gain"))
    assert power.description == "transmit power [dBm]"
    assert power.read_only
    (bounds,) = power.floating_point_range
    assert (bounds.from_value, bounds.to_value) == (-100.0, 60.0)
    (bounds,) = samples.integer_range
    assert (bounds.from_value, bounds.to_value, bounds.step) == (8, 31250, 1)
    # half open bounds have no ROS form
    assert not gain.floating_point_range
    assert gain.description == "gain"


def test_a_descriptor_needs_no_node() -> None:
    (field,) = (f for f in dataclasses.fields(Example) if f.name == "tones_hz")
    assert descriptor(field, tuple[float, ...]).description == "tones [Hz]"


def test_overrides_leave_out_empty_arrays() -> None:
    made = overrides({"zones": (), "channels": (1, 2), "name": "", "gain": 0.0})
    assert {p.name: p.value for p in made} == {"channels": [1, 2], "name": "", "gain": 0.0}
