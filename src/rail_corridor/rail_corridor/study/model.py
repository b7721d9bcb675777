"""What a study file says."""

from __future__ import annotations

import re
from typing import Any

from pydantic import Field, model_validator

from .draws import Draw
from .figures import Figure
from .strict import Strict

_NAME = r"^[a-z][a-z0-9_]*$"
#: Columns that every study has.
RESERVED = ("study", "version", "cell", "run", "seed", "failure")


class HalfWidth(Strict):
    """Enough runs: the 95 % interval of a figure is that narrow."""

    figure: str
    below: float = Field(gt=0.0)
    least_runs: int = Field(10, ge=2)


class Events(Strict):
    """Enough runs: the sum of a figure has reached a number."""

    figure: str
    count: float = Field(gt=0.0)


class Stop(Strict):
    """When a cell has had enough runs; the first rule that is fulfilled ends it."""

    half_width: HalfWidth | None = None
    events: Events | None = None


class Study(Strict):
    """One study: what is run, what is varied, what is looked at.

    A *cell* is one of ``cells`` with one combination of the values in ``vary``; it is run with
    seeds of its own.
    """

    name: str = Field(pattern=_NAME)
    description: str = ""
    scenario: str | dict[str, Any] | None = Field(
        None, description="name, file beside this one, or the scenario itself"
    )
    generator: str | None = Field(None, description="draws a scenario from a seed")
    calculation: str | None = Field(None, description="needs no corridor")
    parameters: dict[str, Any] = Field(
        default_factory=dict, description="of generator or calculation; fields of a scenario"
    )
    cells: tuple[dict[str, Any], ...] = Field(
        (), description="values that go together; all of them set the same fields"
    )
    vary: dict[str, tuple[Any, ...]] = Field(
        default_factory=dict, description="each value of each field with each of the others"
    )
    draw: dict[str, Draw] = Field(default_factory=dict, description="anew for every run")
    runs: int = Field(1, ge=1, le=10_000_000, description="of each cell at most")
    first_seed: int = Field(1, ge=0, lt=2**62)
    figures: dict[str, Figure] = Field(default_factory=dict)
    stop: Stop = Stop()
    group_by: tuple[str, ...] | None = Field(
        None, description="columns of the summary; those of cells and vary if not said"
    )
    timeout_s: float = Field(900.0, gt=0.0, allow_inf_nan=False, description="wall time of one run")

    @property
    def varied(self) -> tuple[str, ...]:
        """Fields that differ from cell to cell."""
        return (*(self.cells[0] if self.cells else ()), *self.vary)

    @property
    def columns(self) -> tuple[str, ...]:
        """What the runs of the summary are grouped by."""
        return self.varied if self.group_by is None else self.group_by

    @model_validator(mode="after")
    def _has_one_source(self) -> Study:
        given = [each for each in (self.scenario, self.generator, self.calculation) if each]
        if len(given) != 1:
            raise ValueError("scenario: one of scenario, generator or calculation is needed")
        return self

    @model_validator(mode="after")
    def _has_cells(self) -> Study:
        if self.cells and not self.cells[0]:
            raise ValueError("cells.0: there is nothing in it")
        for number, cell in enumerate(self.cells):
            for name in {*cell} ^ {*self.cells[0]}:
                raise ValueError(f"cells.{number}: all must set the same, not only some {name}")
        for field, values in self.vary.items():
            if not values:
                raise ValueError(f"vary.{field}: there is no value")
            if self.cells and field in self.cells[0]:
                raise ValueError(f"vary.{field}: is set by the cells already")
        for field in self.draw:
            if field in self.varied:
                raise ValueError(f"draw.{field}: is varied already")
        return self

    @model_validator(mode="after")
    def _leaves_the_seed(self) -> Study:
        for part, names in (
            ("parameters", self.parameters),
            ("cells", self.cells[0] if self.cells else ()),
            ("vary", self.vary),
            ("draw", self.draw),
        ):
            if "seed" in names:
                raise ValueError(f"{part}.seed: is first_seed and the number of the run")
        return self

    @model_validator(mode="after")
    def _has_figures(self) -> Study:
        if not self.figures and self.calculation is None:
            raise ValueError("figures: at least one is needed")
        for name, figure in self.figures.items():
            if not re.fullmatch(_NAME, name) or name in RESERVED or name in self.varied:
                raise ValueError(f"figures.{name}: is no name of a figure, or one of a column")
            for key in ("per", "beside", "cut_off_by"):
                other = getattr(figure, key)
                if other is not None and other not in self.figures:
                    raise ValueError(f"figures.{name}.{key}: is none of the figures")
        for key, rule in (("half_width", self.stop.half_width), ("events", self.stop.events)):
            if rule is not None and rule.figure not in self.figures:
                raise ValueError(f"stop.{key}.figure: is none of the figures")
        return self
