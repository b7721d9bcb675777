"""The model of a scenario file: the common fields, and a section of all equipment."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache, reduce
from operator import or_
from typing import Annotated, Any, get_args

from pydantic import BaseModel, Field, create_model

from rail_corridor.equipment.registry import subsystems
from rail_corridor.scenario.faults import COMMON_FAULTS, Fault
from rail_corridor.scenario.model import Scenario


@lru_cache(maxsize=1)
def scenario_model() -> type[Scenario]:
    """Model of a scenario with the sections and faults of all equipment."""
    sections: dict[str, Any] = {
        section.name: (
            section.kind,
            Field(default=section.default, description=section.description),
        )
        for subsystem in subsystems()
        for section in subsystem.sections
    }
    fault: Any = Annotated[reduce(or_, _kinds_of_faults()), Field(discriminator="kind")]
    common = Scenario.model_fields["faults"]
    sections["faults"] = (
        tuple[fault, ...],
        Field(default=(), max_length=1000, description=common.description),
    )
    made: type[Scenario] = create_model(
        "Scenario", __base__=Scenario, __module__=Scenario.__module__, **sections
    )
    made.__doc__ = Scenario.__doc__
    return made


def _kinds_of_faults() -> tuple[type[Fault], ...]:
    return (*COMMON_FAULTS, *(f for each in subsystems() for f in each.faults))


def parse_scenario(data: object) -> Scenario:
    """A scenario of plain data; no more is checked than each section by itself.

    Raises
    ------
    pydantic.ValidationError
    """
    return scenario_model().model_validate(data)


def fault_fields(kind: str) -> frozenset[str]:
    """Names of the fields of a kind of fault; none if there is no such kind."""
    for fault in _kinds_of_faults():
        if kind in get_args(fault.model_fields["kind"].annotation):
            return frozenset(fault.model_fields)
    return frozenset()


def fault_kinds() -> list[str]:
    """Every kind of fault that a scenario may hold."""
    kinds = (get_args(fault.model_fields["kind"].annotation) for fault in _kinds_of_faults())
    return [kind for some in kinds for kind in some]


def field_names() -> set[str]:
    """Name of every field that a scenario may hold, for suggestions."""
    return {name for model in models_of(scenario_model()) for name in model.model_fields}


def models_of(model: type[BaseModel]) -> Iterator[type[BaseModel]]:
    """Yield a model and the models of its fields, each once, in the order of the file."""
    waiting, seen = [model], {model}
    while waiting:
        model = waiting.pop(0)
        yield model
        for field in model.model_fields.values():
            for found in _models_in(field.annotation):
                if found not in seen:
                    seen.add(found)
                    waiting.append(found)


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)
