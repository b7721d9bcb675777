"""Figures of a report: where they stand, and what is made of several."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final, Literal

from pydantic import Field, model_validator

from rail_corridor.errors import InputError, did_you_mean

from .strict import Strict

Take = Literal["value", "sum", "min", "max", "mean", "count"]
OverRuns = Literal["mean", "sum", "min", "max", "median", "p90", "p95", "proportion", "rate"]

_MOST_NAMED: Final = 8


class Figure(Strict):
    """One figure of a run: a place in its report, and what must hold of it in every run."""

    of: str | None = Field(
        None,
        description="place in the report, * for each of several; the figure's name if not said",
    )
    take: Take = Field("value", description="what is made of the values of one run")
    over_runs: OverRuns = Field("mean", description="what is shown of many runs")
    per: str | None = Field(
        None, description="figure whose sum that of this one is divided by: proportion, rate"
    )
    beside: str | None = Field(None, description="figure in whose diagram it is drawn, as theory")
    cut_off_by: str | None = Field(
        None,
        description="figure that counts what the end of the run has cut off: where it is not 0, "
        "this one is a lower bound",
    )
    must_be: float | None = Field(None, allow_inf_nan=False, description="verdict: in every run")
    at_least: float | None = Field(None, allow_inf_nan=False, description="verdict: in every run")
    at_most: float | None = Field(None, allow_inf_nan=False, description="verdict: in every run")

    @model_validator(mode="after")
    def _can_be(self) -> Figure:
        if None not in (self.at_least, self.at_most) and self.at_least > self.at_most:  # type: ignore[operator]
            raise ValueError("at_least: is more than at_most")
        if self.per is None and self.over_runs == "rate":
            raise ValueError("per: a rate needs the figure that it is a rate of")
        if self.per is not None and self.over_runs not in ("proportion", "rate"):
            raise ValueError("per: is for a proportion or a rate")
        return self

    def violated_by(self, value: float | None) -> bool:
        """Whether a value is not what it must be; one that is not known never is."""
        asked = (self.must_be, self.at_least, self.at_most)
        if value is None or math.isnan(value):
            return any(each is not None for each in asked)
        return (
            (self.must_be is not None and value != self.must_be)
            or (self.at_least is not None and not value >= self.at_least)
            or (self.at_most is not None and not value <= self.at_most)
        )


def figure_of(name: str, figure: Figure, report: Mapping[str, Any]) -> float | None:
    """Value of a figure in a report; None where it is not known.

    Raises
    ------
    InputError
        If the report has no such place.
    """
    place = figure.of or name
    found = list(_at(report, place.split("."), f"figures.{name}", place))
    values = [float(value) for value in found if isinstance(value, bool | int | float)]
    value = _taken(name, figure, place, found, values)
    if figure.over_runs == "proportion" and figure.per is None and value not in (None, 0.0, 1.0):
        reason = f"is {value:g} in a run: a proportion is of what is 0 or 1, or per another figure"
        raise InputError(reason, field=f"figures.{name}", value=place)
    return value


def _taken(
    name: str, figure: Figure, place: str, found: Sequence[Any], values: Sequence[float]
) -> float | None:
    match figure.take:
        case "count":
            return float(len([value for value in found if value is not None]))
        case "sum":
            return math.fsum(values)
        case "value":
            if len(found) > 1:
                reason = "is many values in the report: take sum, min, max, mean or count of them"
                raise InputError(reason, field=f"figures.{name}", value=place)
            if found and found[0] is not None and not values:
                raise InputError("is no number", field=f"figures.{name}", value=place)
            return values[0] if values else None
        case "mean":
            return math.fsum(values) / len(values) if values else None
        case _:
            return {"min": min, "max": max}[figure.take](values) if values else None


def _at(value: Any, path: Sequence[str], field: str, whole: str) -> Iterator[Any]:
    if not path:
        yield value
        return
    key, *rest = path
    inside: Mapping[str, Any]
    if isinstance(value, Mapping):
        inside = value
    elif isinstance(value, list):
        inside = {str(index): each for index, each in enumerate(value)}
    elif value is None:
        yield None
        return
    else:
        inside = {}
    if key == "*":
        for each in inside.values():
            yield from _at(each, rest, field, whole)
        return
    if key not in inside:
        near = did_you_mean(key, map(str, inside))
        there = ", ".join(list(map(str, inside))[:_MOST_NAMED])
        reason = f"the report has no {key} there{near or f'; there are {there}' if there else ''}"
        raise InputError(reason, field=field, value=whole)
    yield from _at(inside[key], rest, field, whole)


def places_of(report: Mapping[str, Any]) -> dict[str, Any]:
    """Places of a report that a figure can be of, and what stands there, of several one."""
    found: dict[str, Any] = {}

    def look(value: Any, place: str, several: bool) -> None:
        if isinstance(value, Mapping | list):
            many = several or isinstance(value, list)
            items = enumerate(value) if isinstance(value, list) else value.items()
            for key, each in items:
                look(each, f"{place}{'*' if many else key}.", place == "" and key == "trains")
        elif not isinstance(value, str) and found.get(place[:-1]) is None:
            found[place[:-1]] = value

    look(report, "", False)
    return found
