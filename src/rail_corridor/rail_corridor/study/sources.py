"""What a run of a study is a run of: a scenario, a drawn scenario, or a calculation."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

from pydantic import BaseModel, ValidationError

from rail_corridor.errors import InputError, from_validation
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.run.kills import Kill
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario

from .corridor_run import run_corridor
from .fields import with_fields
from .figures import Figure, figure_of


class Outcome(NamedTuple):
    """Of one run: what was drawn for it, by column, and its figures."""

    facts: dict[str, Any]
    figures: dict[str, float | None]


class Source(ABC):
    """Where runs come from; goes to the workers as it is."""

    #: Whether a run can be begun only: a calculation cannot.
    has_ticks: ClassVar[bool] = True

    @abstractmethod
    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """Raise InputError for values that there cannot be; starts nothing."""

    @abstractmethod
    def content(self, values: Mapping[str, Any], seed: int) -> str:
        """What a run is a run of, with all that files say: of another content are other runs."""

    @abstractmethod
    def report(
        self, values: Mapping[str, Any], seed: int, ticks: int | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """What was drawn for a run, by column, and its report; of its first ticks if so many."""

    def run(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> Outcome:
        """Make a run; the same for the same arguments wherever it is made."""
        facts, report = self.report(values, seed)
        return Outcome(facts, found(figures, report) if figures else report)

    def try_out(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> None:
        """Raise InputError for figures that a run does not have, by the first tick of one."""
        if self.has_ticks:
            found(figures, self.report(values, seed, ticks=1)[1])


@dataclass(frozen=True)
class ScenarioSource(Source):
    """A scenario some of whose fields vary.

    Parameters
    ----------
    data : mapping
        As of its file.
    directory : Path
        What file names in it are relative to.
    file : str
        Its own; empty if it stands in the study.
    """

    data: Mapping[str, Any]
    directory: Path
    file: str = ""

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """See `Source`."""
        self._scenario(values, seed)

    def report(
        self, values: Mapping[str, Any], seed: int, ticks: int | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `Source`."""
        return {}, run_corridor(self._scenario(values, seed), ticks=ticks).report

    def content(self, values: Mapping[str, Any], seed: int) -> str:
        """See `Source`."""
        return str(self._scenario(values, seed).to_json())

    def _scenario(self, values: Mapping[str, Any], seed: int) -> Any:
        data = with_fields(self.data, {**values, "seed": seed})
        return scenario_from_data(data, directory=self.directory)


class Drawn(NamedTuple):
    """A scenario that was drawn: its data, what dies in it, and what was drawn, by column."""

    data: dict[str, Any]
    kills: tuple[Kill, ...] = ()
    facts: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class GeneratorSource(Source):
    """Scenarios that are drawn from a seed.

    Parameters
    ----------
    parameters : model class
        Of the generator: its fields are what a study may vary.
    draw : callable
        Scenario of the parameters and a seed.
    look : callable, optional
        Further figures of what was drawn and its report; with what was drawn they stand in it
        under ``drawn``.
    judge : callable, optional
        Likewise, of what was drawn, its scenario, and the truth and estimates of its run.
    fixed : mapping
        Parameters that are the same in every run.
    """

    parameters: type[BaseModel]
    draw: Callable[[Any, int], Drawn]
    look: Callable[[Drawn, Mapping[str, Any]], Mapping[str, float | None]] | None = None
    judge: Callable[[Drawn, Scenario, RunData], Mapping[str, float | None]] | None = None
    fixed: Mapping[str, Any] = field(default_factory=dict)

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """See `Source`."""
        scenario_from_data(self.drawn(values, seed).data, directory=Path.cwd())

    def drawn(self, values: Mapping[str, Any], seed: int) -> Drawn:
        """The scenario of a seed.

        Raises
        ------
        InputError
            If there can be no such values.
        """
        return self.draw(checked(self.parameters, {**self.fixed, **values}), seed)

    def report(
        self, values: Mapping[str, Any], seed: int, ticks: int | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `Source`."""
        drawn = self.drawn(values, seed)
        scenario = scenario_from_data(drawn.data, directory=Path.cwd())
        report, data = run_corridor(scenario, kills=drawn.kills, ticks=ticks)
        seen = dict(self.look(drawn, report)) if self.look else {}
        judged = dict(self.judge(drawn, scenario, data)) if self.judge else {}
        report["drawn"] = {**drawn.facts, **seen, **judged}
        return dict(drawn.facts), report

    def content(self, values: Mapping[str, Any], seed: int) -> str:
        """See `Source`."""
        return json.dumps(self.drawn(values, seed).data)


@dataclass(frozen=True)
class CalculationSource(Source):
    """A calculation that needs no corridor.

    Parameters
    ----------
    parameters : model class
        Its fields are what a study may vary.
    calculate : callable
        Figures of the parameters and a seed.
    """

    parameters: type[BaseModel]
    calculate: Callable[[Any, int], Mapping[str, float | None]]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    has_ticks: ClassVar[bool] = False

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """See `Source`."""
        checked(self.parameters, {**self.fixed, **values})

    def report(
        self, values: Mapping[str, Any], seed: int, ticks: int | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `Source`."""
        given = self.calculate(checked(self.parameters, {**self.fixed, **values}), seed)
        return {}, {name: None if each is None else float(each) for name, each in given.items()}

    def content(self, values: Mapping[str, Any], seed: int) -> str:
        """See `Source`: the version of the code tells the rest."""
        return ""


def found(figures: Mapping[str, Figure], report: Mapping[str, Any]) -> dict[str, float | None]:
    """Values of figures in a report."""
    return {name: figure_of(name, each, report) for name, each in figures.items()}


def checked(model: type[BaseModel], values: Mapping[str, Any]) -> BaseModel:
    """Parameters of a generator or calculation; InputError with the field that is wrong."""
    try:
        return model.model_validate(dict(values))
    except ValidationError as error:
        raise from_validation(error, values, model.model_fields) from None


def relative(error: InputError, values: Mapping[str, Any], where: Mapping[str, str]) -> InputError:
    """An error in a field that the study sets, said of the place in the study's file."""
    for name in sorted(values, key=len, reverse=True):
        if error.field == name or error.field.startswith(f"{name}."):
            return InputError(error.reason, field=where[name], value=error.value)
    return error
