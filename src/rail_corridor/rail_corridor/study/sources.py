"""What a run of a study is a run of: a scenario, a drawn scenario, or a calculation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, Protocol

from pydantic import BaseModel, ValidationError

from rail_corridor.errors import InputError, from_validation
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.run.kills import Kill

from .corridor_run import report_of_run
from .fields import with_fields
from .figures import Figure, figure_of


class Outcome(NamedTuple):
    """Of one run: what was drawn for it, by column, and its figures."""

    facts: dict[str, Any]
    figures: dict[str, float | None]


class Source(Protocol):
    """Where runs come from; goes to the workers as it is."""

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """Raise InputError for values that there cannot be; starts nothing."""

    def try_out(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> None:
        """Raise InputError for figures that a run does not have, by the first tick of one."""

    def run(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> Outcome:
        """Make a run; the same for the same arguments wherever it is made."""


@dataclass(frozen=True)
class ScenarioSource:
    """A scenario some of whose fields vary.

    Parameters
    ----------
    data : mapping
        As of its file.
    directory : Path
        What file names in it are relative to.
    """

    data: Mapping[str, Any]
    directory: Path

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """See `Source`."""
        self._scenario(values, seed)

    def try_out(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> None:
        """See `Source`."""
        found(figures, report_of_run(self._scenario(values, seed), ticks=1))

    def run(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> Outcome:
        """See `Source`."""
        return Outcome({}, found(figures, report_of_run(self._scenario(values, seed))))

    def _scenario(self, values: Mapping[str, Any], seed: int) -> Any:
        data = with_fields(self.data, {**values, "seed": seed})
        return scenario_from_data(data, directory=self.directory)


class Drawn(NamedTuple):
    """A scenario that was drawn: its data, what dies in it, and what was drawn, by column."""

    data: dict[str, Any]
    kills: tuple[Kill, ...] = ()
    facts: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class GeneratorSource:
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
    fixed : mapping
        Parameters that are the same in every run.
    """

    parameters: type[BaseModel]
    draw: Callable[[Any, int], Drawn]
    look: Callable[[Drawn, Mapping[str, Any]], Mapping[str, float | None]] | None = None
    fixed: Mapping[str, Any] = field(default_factory=dict)

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """See `Source`."""
        scenario_from_data(self.drawn(values, seed).data, directory=Path.cwd())

    def try_out(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> None:
        """See `Source`."""
        self._outcome(values, seed, figures, ticks=1)

    def run(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> Outcome:
        """See `Source`."""
        return self._outcome(values, seed, figures)

    def drawn(self, values: Mapping[str, Any], seed: int) -> Drawn:
        """The scenario of a seed.

        Raises
        ------
        InputError
            If there can be no such values.
        """
        return self.draw(checked(self.parameters, {**self.fixed, **values}), seed)

    def _outcome(
        self,
        values: Mapping[str, Any],
        seed: int,
        figures: Mapping[str, Figure],
        ticks: int | None = None,
    ) -> Outcome:
        drawn = self.drawn(values, seed)
        scenario = scenario_from_data(drawn.data, directory=Path.cwd())
        report = report_of_run(scenario, kills=drawn.kills, ticks=ticks)
        report["drawn"] = {**drawn.facts, **(self.look(drawn, report) if self.look else {})}
        return Outcome(dict(drawn.facts), found(figures, report))


@dataclass(frozen=True)
class CalculationSource:
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

    def check(self, values: Mapping[str, Any], seed: int) -> None:
        """See `Source`."""
        checked(self.parameters, {**self.fixed, **values})

    def try_out(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> None:
        """See `Source`: a calculation cannot be begun only."""

    def run(self, values: Mapping[str, Any], seed: int, figures: Mapping[str, Figure]) -> Outcome:
        """See `Source`."""
        given = self.calculate(checked(self.parameters, {**self.fixed, **values}), seed)
        report = {name: None if each is None else float(each) for name, each in given.items()}
        if not figures:
            return Outcome({}, report)
        return Outcome({}, found(figures, report))


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
