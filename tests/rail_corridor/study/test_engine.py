"""The engine: rows that do not depend on workers, failures, and going on after an interrupt."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster
from pydantic import BaseModel
from rich.console import Console

from rail_corridor.errors import InputError
from rail_corridor.study.engine import Engine
from rail_corridor.study.figures import Figure
from rail_corridor.study.journal import Entry, entries_of
from rail_corridor.study.model import Study
from rail_corridor.study.run_study import StudyOutcome, run_study
from rail_corridor.study.sources import CalculationSource

pytestmark = pytest.mark.system
QUIET = Console(quiet=True)


class Parameters(BaseModel):
    """Of the calculations below."""

    scale: float = 1.0
    folder: str = ""


def square(parameters: Parameters, seed: int) -> Mapping[str, float]:
    """Return a figure of the seed alone."""
    return {"square": parameters.scale * seed**2, "odd": float(seed % 2)}


def fragile(parameters: Parameters, seed: int) -> Mapping[str, float]:
    """Fail once for seed 2, always for seed 3, kill the worker once for seed 4, hang for 5."""
    mark = Path(parameters.folder) / f"tried_{seed}"
    first = not mark.exists()
    mark.touch()
    if (seed == 2 and first) or seed == 3:
        raise RuntimeError("no luck")
    if seed == 4 and first:
        os.kill(os.getpid(), signal.SIGKILL)
    if seed == 5 and first:
        time.sleep(600.0)
    return {"square": float(seed)}


def study(**changes: Any) -> Study:
    figures = {"square": Figure(), "odd": Figure(over_runs="proportion")}
    data = {"name": "squares", "calculation": "square", "figures": figures, "runs": 6}
    return Study(**(data | {"vary": {"scale": (1.0, 2.0)}} | changes))


def run(out: Path, workers: int, *, resume: bool = False, **changes: Any) -> StudyOutcome:
    source = CalculationSource(Parameters, square)
    return run_study(study(**changes), source, out, QUIET, workers=workers, resume=resume)


def test_rows_are_the_same_for_any_number_of_workers(tmp_path: Path) -> None:
    texts = []
    for workers in (1, 2, 4):
        outcome = run(tmp_path / str(workers), workers)
        assert len(outcome.entries) == 12 and not outcome.failed
        texts.append((tmp_path / str(workers) / "rows.csv").read_text())
    assert len({*texts}) == 1
    header, first, *_ = texts[0].splitlines()
    assert header == "study,version,cell,run,seed,scale,square,odd,failure"
    assert first.startswith("squares,") and first.endswith(",0,0,1,1.0,1.0,1.0,")
    (one, _) = outcome.groups
    assert one.estimates["square"].value == pytest.approx(91 / 6)
    assert (tmp_path / "1" / "summary.png").read_bytes().startswith(b"\x89PNG")


def test_it_goes_on_where_it_was(tmp_path: Path) -> None:
    whole = run(tmp_path / "whole", 1)
    run(tmp_path / "parts", 1, runs=2)
    journal = tmp_path / "parts" / "journal.jsonl"
    with journal.open("a") as file:
        file.write('{"cell": 0, "run": 2, "se')  # as a crash leaves it
    with pytest.raises(InputError, match="go on with --resume"):
        run(tmp_path / "parts", 1)
    again = run(tmp_path / "parts", 1, resume=True)
    assert [e.figures for e in again.entries] == [e.figures for e in whole.entries]
    made = [entry.key for entry in entries_of(journal)]
    assert len(made) == len({*made}) == 12
    with pytest.raises(InputError, match="of another study"):
        run(tmp_path / "parts", 1, resume=True, first_seed=9)


@pytest.fixture
def client() -> Iterator[Client]:
    """Return a client of two workers."""
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as found,
    ):
        yield found


def test_what_fails_dies_or_hangs_is_made_once_more(client: Client, tmp_path: Path) -> None:
    from rail_corridor.study.cells import case_of, cells_of

    asked = study(parameters={"folder": str(tmp_path)}, vary={}, first_seed=1)
    source = CalculationSource(Parameters, fragile, asked.parameters)
    cases = [case_of(asked, cells_of(asked), 0, number) for number in range(6)]
    engine = Engine(client, source, {"square": Figure()}, timeout_s=2.0, grace_s=1.0)

    def more(count: int) -> list[Any]:
        return [cases.pop(0) for _ in range(min(count, len(cases)))]

    found: dict[int, Entry] = {entry.seed: entry for entry in engine.results(more)}
    assert sorted(found) == [1, 2, 3, 4, 5, 6]
    assert [seed for seed, entry in found.items() if entry.failure] == [3]
    assert found[3].failure == "RuntimeError: no luck"
    assert all(found[seed].figures == {"square": seed} for seed in (1, 2, 4, 5, 6))
