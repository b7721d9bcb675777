"""The reference of the scenario file, made from its model for docs/scenarios.md."""

from __future__ import annotations

import re
from typing import Any, Literal, get_args, get_origin

from pydantic import BaseModel
from pydantic_core import PydanticUndefined

from rail_world.line.description_base import quantity_of_field
from rail_world.trains.description import Davis, VehicleDescription

from .schema import models_of, scenario_model


def field_tables() -> str:
    """Return one Markdown table per section of a scenario file, with every field."""
    return "\n\n".join(_table(model) for model in models_of(scenario_model()))


def _table(model: type[BaseModel]) -> str:
    summary = (model.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ").replace("``", "`")
    rows = [
        f"### {model.__name__}",
        "",
        summary,
        "",
        "| Field | Default | Meaning |",
        "|---|---|---|",
    ]
    for name, field in model.model_fields.items():
        meaning = field.description or "which kind it is"
        quantity = quantity_of_field(field)
        if quantity is not None and quantity.choices:
            meaning += f"; one of {', '.join(map(str, quantity.choices))}"
        elif choices := _choices(field.annotation):
            meaning += f": {choices}"
        if bounds := _bounds(field.metadata):
            meaning += f"; {bounds}"
        rows.append(f"| `{name}` | {_default(model, field)} | {meaning} |")
    return "\n".join(rows)


def _choices(annotation: Any) -> str:
    """Values of a field that takes one of a few."""
    if get_origin(annotation) is not Literal:
        return ""
    return ", ".join(f"`{value}`" for value in get_args(annotation))


def _default(model: type[BaseModel], field: Any) -> str:
    if field.default_factory is not None:
        return "its defaults"
    if field.default is PydanticUndefined:
        return "the preset's" if model in (VehicleDescription, Davis) else "needed"
    if isinstance(field.default, BaseModel):
        return "its defaults"
    if field.default is None:
        return "null"
    if field.default is True or field.default is False:
        return str(field.default).lower()
    if field.default == "":
        return "empty"
    if isinstance(field.default, tuple):
        return re.sub(r",\]", "]", str(field.default).replace("(", "[").replace(")", "]"))
    return f"{field.default:.12g}" if isinstance(field.default, float) else str(field.default)


def _bounds(metadata: list[Any]) -> str:
    parts = []
    for item in metadata:
        for key, text in (("gt", "above"), ("ge", "from"), ("lt", "below"), ("le", "to")):
            if (value := getattr(item, key, None)) is not None:
                parts.append(f"{text} {value:.12g}")
    return " ".join(parts)
