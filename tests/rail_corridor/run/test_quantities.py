"""A quantity has one declaration, from the scenario file to medium and node.

One field of a scenario after the other gets another value; wherever that value comes out again -
as a node parameter, or in what a medium knows of the world - it must be the same quantity.
"""

from __future__ import annotations

import dataclasses
import importlib
import math
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin

import pytest
from pydantic import BaseModel, Field
from pydantic.fields import FieldInfo

import rail_msgs_py
from rail_corridor.cli.topic_docs import parameters_of
from rail_corridor.equipment.registry import BUILTIN, node_kinds, subsystems
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.schema import models_of, parse_scenario, scenario_model
from rail_corridor.plan.plan import make_plan
from rail_corridor.plan.world_plan import world_file
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.parameters import parameter
from rail_msgs_py.quantity import NEEDED, Quantity, quantity_of
from rail_msgs_py.track_code.quantities import BRAKING as CODE_BRAKING
from rail_msgs_py.train_radio.quantities import BRAKING
from rail_world.line.description_base import Description, field_of, quantity_of_field, range_of
from rail_world.world_file import WorldFile

#: Together they have every section, and every kind of fault that has a quantity.
SCENARIOS = ("jammed_channel", "located_codes", "hostile_network", "tunnel", "failing_bus")
#: What the built-in scenarios leave out.
ADDED = {
    "located_codes": [
        {"kind": "detuned_reference", "station": "ref1", "shift_hz": 20.0, "from_s": 1.0},
        {"kind": "sanding", "train": "leader", "loss_db": 33.0},
        {"kind": "wheel_slip", "train": "leader", "ratio": 1.1},
    ],
}
#: Which kind a thing is, and what a file has of places: no quantities.
NO_QUANTITIES = {"kind", "fault", "route", "tracks", "junctions", "timetable", "positions"}
#: Models whose quantities reach other nodes in each scenario; those of a section do not.
COMMON = {"Scenario", "TrainDescription"}
Place = tuple[str | int, ...]


class Sink(NamedTuple):
    """Where a value comes out: name, value, quantity, default (if any), type in a description."""

    name: str
    value: Any
    quantity: Quantity[Any] | None
    default: Any
    type: Any = None


def leaves(
    model: BaseModel, place: Place = ()
) -> Iterator[tuple[type[BaseModel], Place, Any, Any]]:
    """Yield model, place, field and value of each number, choice or list of them in a file."""
    for name, field in type(model).model_fields.items():
        if name in NO_QUANTITIES:
            continue
        value, here = getattr(model, name), (*place, name)
        if isinstance(value, BaseModel):
            yield from leaves(value, here)
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for index, item in enumerate(value):
                yield from leaves(item, (*here, index))
        elif (
            isinstance(value, bool | int | float)
            or (value and isinstance(value, tuple))
            or len(_choices(field.annotation)) > 1
        ):
            yield type(model), here, field, value


def _choices(annotation: Any) -> tuple[Any, ...]:
    return get_args(annotation) if get_origin(annotation) is Literal else ()


def others(value: Any, annotation: Any) -> Iterator[Any]:
    """Yield other values that a field might have; none of those that are nothing."""
    return (other for other in candidates(value, annotation) if other not in (value, ()))


def candidates(value: Any, annotation: Any) -> Iterator[Any]:
    """Yield values to try in the place of one."""
    if isinstance(value, bool):
        yield not value
    elif choices := _choices(annotation):
        yield from (choice for choice in choices if choice != value)
    elif isinstance(value, int):
        yield from (value + 1, value - 1, 2 * value, value // 2)
    elif isinstance(value, float):
        # A few digits of its own; multiples where a field has to be a whole number of something.
        yield from (1.0317 * value, 0.9713 * value, value + 0.0317, 2.0 * value, 0.5 * value)
    elif isinstance(value, tuple):
        yield from (value[::-1], value[1:], value * 2)


def with_value(scenario: Scenario, place: Place, value: Any) -> Scenario:
    """Return the scenario with another value at a place.

    Raises
    ------
    ValidationError
        If it cannot be.
    """
    data: Any = scenario.model_dump()
    inner = data
    for step in place[:-1]:
        if isinstance(inner[step], tuple):
            inner[step] = list(inner[step])
        inner = inner[step]
    inner[place[-1]] = value
    return parse_scenario(data)


def sinks(scenario: Scenario, directory: Path) -> dict[str, Sink]:
    """All that the nodes and media of a scenario are given, by where it is."""
    found = {}
    for spec in make_plan(scenario, directory).nodes:
        fields = {field.name: field for field in dataclasses.fields(parameters_of(spec.kind))}
        for name, value in spec.parameters.items():
            where, field = f"{spec.name} {spec.kind}.{name}", fields[name]
            found[where] = Sink(where, value, quantity_of(field), field.default)
    world = world_file(scenario)
    for name in ("tick_s", "seed", "odometer_error"):
        found |= {sink.name: sink for sink in described(world, "world") if name in sink.name}
    for each in (*world.stops, *world.slips):
        found |= {sink.name: sink for sink in described(each, f"world of {each.train}")}
    for subsystem in subsystems():
        for part, description in subsystem.world(scenario).items():
            found |= {sink.name: sink for sink in described(description, part)}
    return found


def described(model: BaseModel, where: str) -> Iterator[Sink]:
    """What is given in a description, and in those within it."""
    for name in sorted(model.model_fields_set):
        field, value = type(model).model_fields[name], getattr(model, name)
        here = f"{where} {type(model).__name__}.{name}"
        default = dataclasses.MISSING if field.is_required() else field.get_default()
        kind = (field.annotation, field.metadata)
        yield Sink(here, value, quantity_of_field(field), default, kind)
        for index, inner in enumerate(value if isinstance(value, tuple) else (value,)):
            if isinstance(inner, BaseModel):
                yield from described(inner, f"{here} {index}")


def complaint(field: FieldInfo, sink: Sink) -> str:
    """What is declared twice where the value of a field is handed over, empty if nothing."""
    quantity = quantity_of_field(field)
    if quantity is None and sink.type == (field.annotation, field.metadata):
        # One type for both, as of a chainage: without a default there is nothing else to declare.
        return "" if field.is_required() and sink.default is NEEDED else "has a default in the type"
    if quantity is None or sink.quantity is None:
        return "declares it for itself"
    if sink.quantity.origin is not quantity.origin:
        return "is of another declaration"
    if sink.quantity.unit != quantity.unit:
        return f"counts in {sink.quantity.unit}, not {quantity.unit}"
    if sink.default in (NEEDED, None):
        return ""
    if sink.type is not None or sink.default != quantity.default:
        return f"has a default of its own, {sink.default}"
    return ""


@pytest.fixture(scope="module")
def handed_over(tmp_path_factory: Any) -> list[tuple[str, str, str]]:
    """Field, where its value comes out, and the complaint: of all that comes out, once a field."""
    directory: Path = tmp_path_factory.mktemp("plans")
    waiting, done, found = set[str](), set[str](), []
    for name in SCENARIOS:
        data = load_scenario(name).model_dump()
        data["faults"] = [*data["faults"], *ADDED.get(name, [])]
        base = parse_scenario(data)
        before = sinks(base, directory)
        for model, place, field, value in leaves(base):
            what = f"{model.__name__}.{place[-1]}"
            if what in done and not (model.__name__ in COMMON and quantity_of_field(field)):
                continue
            waiting.add(what)
            other, after = changed(base, place, others(value, field.annotation), directory)
            if not after:  # another scenario may leave room for another value
                continue
            done.add(what)
            for sink in after.values():
                was = before.get(sink.name)
                if was is not None and was.value == value and sink.value == other:
                    found.append((what, sink.name, complaint(field, sink)))
    assert waiting == done, "only the values of the built-in scenarios can be there"
    return found


def changed(
    scenario: Scenario, place: Place, values: Iterator[Any], directory: Path
) -> tuple[Any, dict[str, Sink]]:
    """Return the first of the values that can be at a place, and what comes out; none if none."""
    for value in values:
        try:
            return value, sinks(with_value(scenario, place, value), directory)
        except (ValueError, ArithmeticError, LookupError, InputError):
            continue
    return None, {}


def test_what_is_handed_over_is_of_the_declaration_of_its_section(handed_over: Any) -> None:
    wrong = [entry for entry in handed_over if entry[2]]
    assert not wrong, "\n".join(map(str, wrong))


def test_the_trace_finds_what_is_handed_over_under_another_name(handed_over: Any) -> None:
    ends: dict[str, set[str]] = {}
    for what, name, _ in handed_over:
        ends.setdefault(what, set()).add(name.split()[-1])
    assert ends["CbtcPlan.timeout_s"] == {"atp.authority_timeout_s", "zone_controller.validity_s"}
    assert {"localizer.tick_s", "bus_terminal.tick_s", "WorldFile.tick_s"} < ends["Scenario.tick_s"]
    assert ends["TrackCircuitPlan.joint_db"] == {"RailDescription.joint_attenuation_db"}
    assert ends["BusPlan.reflectometer_noise"] == {
        "train_bus_monitor.noise_rms",
        "BusDescription.reflectometer_noise",
    }
    assert ends["Jam.power_dbm"] == {"RadioFault.power_dbm"}
    assert len(ends) > 70


def test_every_section_is_in_the_scenarios_that_are_traced() -> None:
    scenarios = [load_scenario(name) for name in SCENARIOS]
    for subsystem in BUILTIN:
        for section in subsystem.sections:
            assert any(section.of(scenario) is not None for scenario in scenarios), section.name
    kinds = {fault.kind for scenario in scenarios for fault in scenario.faults}
    kinds |= {fault["kind"] for faults in ADDED.values() for fault in faults}
    quantities = {"bus_fault", "detuned_reference", "jam", "sanding", "threat", "wheel_slip"}
    assert quantities <= kinds


@pytest.mark.parametrize("name", SCENARIOS)
def test_what_a_medium_is_always_given_has_no_default(name: str) -> None:
    scenario = load_scenario(name)
    parts = [
        sink
        for subsystem in subsystems()
        for part, description in subsystem.world(scenario).items()
        for sink in described(description, part)
    ]
    assert parts
    # None: it does not apply; an empty list: there are none.
    assert [sink for sink in parts if sink.default not in (NEEDED, None, ())] == []


class Declared(Description):
    """Fields as a section, and as a medium, might have them."""

    braking: float = field_of(BRAKING)
    shared: Annotated[float, range_of(BRAKING)]
    second: Annotated[float, range_of(BRAKING)] = 0.7
    alone: float = Field(default=0.7, ge=0.1, le=2.0)
    other: Annotated[float, range_of(CODE_BRAKING)]


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Parameters as a node might have them."""

    shared: float = BRAKING.parameter()
    second: float = BRAKING.but(default=0.8).parameter()
    rounded: float = BRAKING.derived(lambda mps2: 3.6 * mps2, "braking", "km/h/s").parameter()
    alone: float = parameter(0.7, "service braking", unit="m/s^2", low=0.1, high=2.0)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("shared", ""),
        ("second", "has a default of its own, 0.7"),
        ("alone", "declares it for itself"),
        ("other", "is of another declaration"),
    ],
)
def test_a_second_declaration_in_a_description_is_found(name: str, words: str) -> None:
    field = Declared.model_fields[name]
    default = NEEDED if field.is_required() else field.default
    sink = Sink(name, 0.5, quantity_of_field(field), default, type=(field.annotation, ()))
    assert complaint(Declared.model_fields["braking"], sink) == words


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("shared", ""),
        ("second", "has a default of its own, 0.8"),
        ("rounded", "counts in km/h/s, not m/s^2"),
        ("alone", "is of another declaration"),
    ],
)
def test_a_second_declaration_in_a_node_is_found(name: str, words: str) -> None:
    (field,) = (field for field in dataclasses.fields(Parameters) if field.name == name)
    sink = Sink(name, 0.5, quantity_of(field), field.default)
    assert complaint(Declared.model_fields["braking"], sink) == words


def declarations() -> dict[str, Quantity[Any]]:
    """Every quantity by its module and name."""
    found = {}
    for module in pkgutil.walk_packages(rail_msgs_py.__path__, "rail_msgs_py."):
        if module.name.rpartition(".")[2] == "quantities":
            for name, value in vars(importlib.import_module(module.name)).items():
                if isinstance(value, Quantity):
                    found[f"{module.name}.{name}"] = value
    return found


def uses() -> Iterator[Quantity[Any]]:
    """Quantities of all fields of sections, descriptions and node parameters."""
    for kind in node_kinds():
        yield from (quantity_of(field) for field in dataclasses.fields(parameters_of(kind)))
    waiting: list[type[BaseModel]] = [Description]
    models = [*models_of(scenario_model()), WorldFile]
    while waiting:
        waiting += (more := waiting.pop().__subclasses__())
        models += more
    for model in models:
        found = (quantity_of_field(field) for field in model.model_fields.values())
        yield from (quantity for quantity in found if quantity is not None)


def test_no_quantity_is_declared_in_vain() -> None:
    used = set()
    for quantity in uses():
        while quantity is not None:
            used.add(quantity)
            quantity = quantity.source
    assert [name for name, quantity in declarations().items() if quantity not in used] == []


def test_bounds_hold_the_default_and_every_choice() -> None:
    for name, quantity in declarations().items():
        if quantity.default is not NEEDED:
            assert quantity.refusal(quantity.default) == "", name
        assert quantity.low <= quantity.high, name
        assert not (quantity.choices and math.isfinite(quantity.low)), name
