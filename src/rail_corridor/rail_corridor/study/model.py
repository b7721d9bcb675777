"""What a study file says."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from .draws import Draw
from .figures import Figure

_NAME = r"^[a-z][a-z0-9_]*$"


class HalfWidth(BaseModel):
    """Enough runs: the 95 % interval of a figure is that narrow."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    figure: str
    below: float = Field(gt=0.0)
    least_runs: int = Field(10, ge=2)


class Events(BaseModel):
    """Enough runs: the sum of a figure has reached a number."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    figure: str
    count: float = Field(gt=0.0)


class Stop(BaseModel):
    """When a cell has had enough runs; the first rule that is fulfilled ends it."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    half_width: HalfWidth | None = None
    events: Events | None = None


class Study(BaseModel):
    """One study: what is run, what is varied, what is looked at.

    A *cell* is one combination of the values in ``vary``; it is run with seeds of its own.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

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
    vary: dict[str, tuple[Any, ...]] = Field(
        default_factory=dict, description="each value of each field with each of the others"
    )
    draw: dict[str, Draw] = Field(default_factory=dict, description="anew for every run")
    runs: int = Field(1, ge=1, le=10_000_000, description="of each cell at most")
    first_seed: int = Field(1, ge=0, lt=2**62)
    figures: dict[str, Figure] = Field(default_factory=dict)
    stop: Stop = Stop()
    group_by: tuple[str, ...] | None = Field(
        None, description="columns of the summary; those of vary if not said"
    )
    timeout_s: float = Field(900.0, gt=0.0, description="wall time of one run")

    @model_validator(mode="after")
    def _has_one_source(self) -> Study:
        given = [each for each in (self.scenario, self.generator, self.calculation) if each]
        if len(given) != 1:
            raise ValueError("scenario: one of scenario, generator or calculation is needed")
        twice = {*self.vary} & {*self.draw}
        if twice:
            raise ValueError(f"draw.{min(twice)}: is varied already")
        for field, values in self.vary.items():
            if not values:
                raise ValueError(f"vary.{field}: there is no value")
        if not self.figures and self.calculation is None:
            raise ValueError("figures: at least one is needed")
        if self.figures:
            for rule in (self.stop.half_width, self.stop.events):
                if rule is not None and rule.figure not in self.figures:
                    raise ValueError(f"stop: {rule.figure!r} is none of the figures")
        return self
