"""The tables of docs/studies.md: studies that come along, generators, calculations."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from rail_corridor.study.study_file import descriptions

from .registry import CALCULATIONS, FOLDER, GENERATORS


def tables() -> str:
    """Markdown of all of them."""
    return "\n".join(
        [
            "| Study | What it asks |",
            "|---|---|",
            *(f"| `{name}` | {asked} |" for name, asked in descriptions(FOLDER).items()),
            "",
            *_sources("Generator", {name: (g, g.draw) for name, g in GENERATORS.items()}),
            "",
            *_sources("Calculation", {name: (c, c.calculate) for name, c in CALCULATIONS.items()}),
        ]
    )


def _sources(kind: str, sources: Mapping[str, Any]) -> Iterator[str]:
    yield f"| {kind} | What it draws or counts | Parameters |"
    yield "|---|---|---|"
    for name, (source, function) in sources.items():
        what = (function.__doc__ or "").strip().splitlines()[0]
        fields = source.parameters.model_fields.items()
        parameters = "; ".join(_parameter(each, field) for each, field in fields)
        yield f"| `{name}` | {re.sub('`+', '`', what)} | {parameters or 'none'} |"


def _parameter(name: str, field: FieldInfo) -> str:
    said = f"`{name}` {_values(field)}"
    if field.description:
        said += f", {field.description}"
    return f"{said} ({field.default})" if field.default is not None else said


def _values(field: FieldInfo) -> str:
    """What a parameter can be."""
    bounds = {type(each).__name__.lower(): each for each in field.metadata}
    if "ge" in bounds and "le" in bounds:
        return f"from {bounds['ge'].ge:g} to {bounds['le'].le:g}"
    choices = list(_choices(field.annotation))
    return " \\| ".join(choices)


def _choices(annotation: Any) -> Iterator[str]:
    if get_origin(annotation) is Literal:
        yield from map(str, get_args(annotation))
    elif isinstance(annotation, type):
        members = getattr(annotation, "__members__", None)
        yield from (str(m.value) for m in members.values()) if members else [_KINDS[annotation]]
    else:
        for each in get_args(annotation):
            if each is not type(None):
                yield from _choices(each)


_KINDS = {str: "a name", int: "an integer", float: "a number", bool: "true or false"}
