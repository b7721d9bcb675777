"""Loading studies: a file, or one that comes with the corridor, validated before anything runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError
from rich.console import Console
from rich.table import Table

from rail_corridor.errors import InputError, did_you_mean, from_validation
from rail_corridor.loading.loader import builtin_scenarios
from rail_corridor.yaml_file import load_yaml

from .cells import case_of, cells_of
from .fields import with_fields
from .model import Study
from .sources import CalculationSource, GeneratorSource, ScenarioSource, Source, relative

#: Parts of a study whose keys are fields of what it runs.
_OF_FIELDS: Final = ("parameters", "vary", "draw")


def load_study(
    name_or_path: str,
    folder: Path,
    generators: Mapping[str, GeneratorSource],
    calculations: Mapping[str, CalculationSource],
    overrides: Mapping[str, Any] | None = None,
) -> tuple[Study, Source]:
    """Load a study and see that every value in it can be.

    Parameters
    ----------
    name_or_path : str
        A YAML file, or the name of one in ``folder``.
    folder : Path
        Studies that come with the corridor.
    generators, calculations : mappings
        What a study may name.
    overrides : mapping, optional
        Fields of the study by their dotted names, and the values that they have instead.

    Raises
    ------
    InputError
        One line that names the file, the field and the value.
    """
    path = _find(name_or_path, folder)
    try:
        data = _changed(load_yaml(path), overrides or {})
        try:
            study = Study.model_validate(data)
        except ValidationError as error:
            raise from_validation(error, data, Study.model_fields) from None
        source = _source_of(study, path.parent, generators, calculations)
        _check(study, source)
    except InputError as error:
        raise error.located(str(path)) from None
    return study, source


def _changed(data: Mapping[str, Any], overrides: Mapping[str, Any]) -> dict[str, Any]:
    """A study with other values; names of a scenario's fields in it have dots of their own."""
    changed = dict(data)
    for name, value in overrides.items():
        section, _, field = name.partition(".")
        if field and section in _OF_FIELDS and isinstance(changed.get(section, {}), dict):
            changed[section] = {**changed.get(section, {}), field: value}
        else:
            changed = with_fields(changed, {name: value})
    return changed


def list_studies(folder: Path, console: Console) -> None:
    """Show what studies come with the corridor."""
    table = Table(box=None, show_header=False)
    for name, description in descriptions(folder).items():
        table.add_row(name, description)
    console.print(table)


def descriptions(folder: Path) -> dict[str, str]:
    """What the studies of a folder ask, by their names."""
    return {name: str(load_yaml(path)["description"]) for name, path in _studies(folder).items()}


def _studies(folder: Path) -> dict[str, Path]:
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def _find(name: str, folder: Path) -> Path:
    known = _studies(folder)
    if name in known:
        return known[name]
    path = Path(name)
    if path.suffix in (".yaml", ".yml") or path.exists():
        return path
    reason = f"no such study{did_you_mean(name, known)}; there are {', '.join(known)}"
    raise InputError(reason, field="STUDY", value=name)


def _source_of(
    study: Study,
    directory: Path,
    generators: Mapping[str, GeneratorSource],
    calculations: Mapping[str, CalculationSource],
) -> Source:
    if study.generator is not None:
        drawn: GeneratorSource = _named(study.generator, generators, "generator")
        return replace(drawn, fixed=study.parameters)
    if study.calculation is not None:
        known: CalculationSource = _named(study.calculation, calculations, "calculation")
        return replace(known, fixed=study.parameters)
    assert study.scenario is not None
    data, path = _scenario_data(study.scenario, directory)
    file = "" if path.is_dir() else str(path)
    folder = path if path.is_dir() else path.parent
    return ScenarioSource(with_fields(data, study.parameters), folder, file)


def _named(name: str, known: Mapping[str, Any], field: str) -> Any:
    if name not in known:
        reason = f"there are {', '.join(sorted(known))}{did_you_mean(name, known)}"
        raise InputError(reason, field=field, value=name)
    return known[name]


def _scenario_data(
    scenario: str | dict[str, Any], directory: Path
) -> tuple[Mapping[str, Any], Path]:
    """A scenario as plain data, and its file; the folder of the study if it stands in that."""
    if isinstance(scenario, dict):
        return scenario, directory
    builtin = builtin_scenarios()
    path = builtin.get(scenario, directory / scenario)
    if not path.is_file():
        reason = f"is neither built in nor beside the study{did_you_mean(scenario, builtin)}"
        raise InputError(reason, field="scenario", value=scenario)
    return load_yaml(path), path


def _check(study: Study, source: Source) -> None:
    """See that every value of every field can be, with the first values of all others."""
    where = {
        **{name: f"parameters.{name}" for name in study.parameters},
        **{name: f"cells.*.{name}" for name in study.varied},
        **{name: f"vary.{name}" for name in study.vary},
        **{name: f"draw.{name}" for name in study.draw},
    }
    first = dict(case_of(study, cells_of(study), 0, 0).values)
    first |= {name: law.extremes()[0] for name, law in study.draw.items()}
    changes: list[Mapping[str, Any]] = [{}, *study.cells[1:]]
    changes += [{name: value} for name, values in study.vary.items() for value in values[1:]]
    changes += [{name: end} for name, law in study.draw.items() for end in law.extremes()]
    for change in changes:
        values = {**first, **change}
        try:
            source.check(values, study.first_seed)
        except InputError as error:
            ours = relative(error, {**study.parameters, **values}, where)
            if ours is error and isinstance(source, ScenarioSource) and source.file:
                raise error.located(source.file) from None
            raise ours from None
    _check_columns(study, source, first)


def _check_columns(study: Study, source: Source, values: Mapping[str, Any]) -> None:
    known = [*study.varied, *study.draw]
    if isinstance(source, GeneratorSource):
        known += source.drawn(values, study.first_seed).facts
    for name in study.columns:
        if name not in known:
            reason = f"is neither varied nor drawn{did_you_mean(name, known)}"
            raise InputError(reason, field="group_by", value=name)
