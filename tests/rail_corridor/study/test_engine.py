"""The engine: rows that do not depend on workers, failures, and going on after an interrupt."""

from __future__ import annotations

import fcntl
import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from distributed import Client, LocalCluster
from pydantic import BaseModel
from rich.console import Console

from rail_corridor.errors import InputError
from rail_corridor.study.cells import case_of, cells_of
from rail_corridor.study.engine import Engine, LostClusterError
from rail_corridor.study.figures import Figure
from rail_corridor.study.journal import Entries, Entry
from rail_corridor.study.model import Study
from rail_corridor.study.run_study import Where, alone_in, run_study
from rail_corridor.study.single_run import show_run
from rail_corridor.study.sources import CalculationSource
from rail_corridor.study.version import code_version

pytestmark = pytest.mark.system
QUIET = Console(quiet=True)


@pytest.fixture(autouse=True, scope="module")
def _workers_find_this_module() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).parents[3]))
        yield


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
        threading.Event().wait()
    return {"square": float(seed)}


def study(**changes: Any) -> Study:
    figures = {"square": Figure(), "odd": Figure(over_runs="proportion")}
    data = {"name": "squares", "calculation": "square", "figures": figures, "runs": 6}
    return Study(**(data | {"vary": {"scale": (1.0, 2.0)}} | changes))


@pytest.fixture(scope="module")
def cluster(_workers_find_this_module: None) -> Iterator[LocalCluster]:
    """Return a cluster of two workers that many tests use."""
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as found:
        yield found


@pytest.fixture
def here(cluster: LocalCluster) -> Where:
    """Return where runs are made."""
    return Where(scheduler=cluster.scheduler_address)


@pytest.fixture
def client(cluster: LocalCluster) -> Iterator[Client]:
    """Return a client of two workers."""
    with Client(cluster) as found:
        yield found


def run(out: Path, where: Where, *, resume: bool = False, **changes: Any) -> Entries:
    source = CalculationSource(Parameters, square)
    asked = study(**changes)
    assert run_study(asked, source, out, QUIET, "", where=where, resume=resume) == 0
    return Entries(out / "journal.jsonl")


def test_rows_are_the_same_for_any_number_of_workers(tmp_path: Path) -> None:
    texts = []
    for workers in (1, 2, 4):
        assert len(run(tmp_path / str(workers), Where(workers=workers))) == 12
        texts.append((tmp_path / str(workers) / "rows.csv").read_text())
    assert len({*texts}) == 1
    header, first, *_ = texts[0].splitlines()
    assert header == "study,version,cell,run,seed,scale,square,odd,failure"
    assert first.startswith("squares,") and first.endswith(",0,0,1,1.0,1,1,")
    assert (tmp_path / "1" / "summary.png").read_bytes().startswith(b"\x89PNG")


def test_it_goes_on_where_it_was(tmp_path: Path, here: Where) -> None:
    whole = run(tmp_path / "whole", here)
    run(tmp_path / "parts", here, runs=2)
    journal = tmp_path / "parts" / "journal.jsonl"
    with journal.open("a") as file:
        file.write('{"cell": 0, "run": 2, "se')  # as a crash leaves it
    with pytest.raises(InputError, match="go on with --resume"):
        run(tmp_path / "parts", here)
    again = run(tmp_path / "parts", here, resume=True)
    assert [e.figures for e in again] == [e.figures for e in whole]
    made = journal.read_text().splitlines()[1:]
    assert len(made) == 12
    with pytest.raises(InputError, match="of another study"):
        run(tmp_path / "parts", here, resume=True, first_seed=9)


def test_a_figure_that_there_is_not_is_told_before_anything_is_left(
    tmp_path: Path, here: Where
) -> None:
    figures = {"squared": Figure()}
    with pytest.raises(InputError, match=r"figures\.squared: .*did you mean square"):
        run(tmp_path / "none", here, figures=figures)
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(("scale", "said"), [(1.0, "nothing has moved"), (50.0, "moved: square")])
def test_what_has_moved_is_told(tmp_path: Path, here: Where, scale: float, said: str) -> None:
    asked = study(vary={}, figures={"square": Figure(over_runs="sum")})
    console = Console(width=100, record=True, file=io.StringIO())
    before, now = tmp_path / "before", tmp_path / "now"
    codes = []
    for out, factor, compare in ((before, 1.0, None), (now, scale, before)):
        source = CalculationSource(Parameters, square, {"scale": factor})
        codes.append(run_study(asked, source, out, console, "", where=here, compare=compare))
    assert codes == [0, int(scale != 1.0)]
    assert said in console.export_text()


def test_what_fails_dies_or_hangs_is_made_once_more(client: Client, tmp_path: Path) -> None:
    asked = study(parameters={"folder": str(tmp_path)}, vary={}, first_seed=1)
    source = CalculationSource(Parameters, fragile, asked.parameters)
    cases = [case_of(asked, cells_of(asked), 0, number) for number in range(6)]
    engine = Engine(client, source, {"square": Figure()}, 2.0, code_version(), grace_s=6.0)

    def more(count: int) -> list[Any]:
        return [cases.pop(0) for _ in range(min(count, len(cases)))]

    found: dict[int, Entry] = {entry.seed: entry for entry in engine.results(more)}
    assert sorted(found) == [1, 2, 3, 4, 5, 6]
    assert [seed for seed, entry in found.items() if entry.failure] == [3]
    assert found[3].failure == "RuntimeError: no luck"
    assert all(found[seed].figures == {"square": seed} for seed in (1, 2, 4, 5, 6))


def test_what_must_hold_is_told_with_the_command_that_repeats_it(
    tmp_path: Path, here: Where
) -> None:
    figures = {"square": Figure(at_most=30), "odd": Figure(over_runs="proportion")}
    asked = study(figures=figures, vary={"scale": (1.0,)})
    source = CalculationSource(Parameters, square)
    console = Console(width=100, record=True, file=io.StringIO())
    assert run_study(asked, source, tmp_path / "a", console, "rail study s.yaml", where=here) == 1
    assert "square is 36: rail study s.yaml --only 0:5" in console.export_text()
    codes = {place: show_run(asked, source, place, console) for place in ("0:4", "0:5")}
    assert codes == {"0:4": 0, "0:5": 1}
    said = console.export_text().splitlines()
    assert said == ["seed: 5", *said[1:4], "seed: 6", *said[5:]] and "square: 36.0" in said
    with pytest.raises(InputError, match="--only: '1:0': must be CELL:RUN, a cell from 0 to 0"):
        show_run(asked, source, "1:0", console)


def test_a_study_that_is_over_is_shown_without_a_worker(tmp_path: Path, here: Where) -> None:
    run(tmp_path / "a", here)
    nowhere = Where(scheduler="tcp://127.0.0.1:9")
    assert len(run(tmp_path / "a", nowhere, resume=True)) == 12


TWO_STUDIES = """
import os
from pathlib import Path
from rail_corridor.study.cluster import client_of
from rail_corridor.study.corridor_run import SCRATCH
if __name__ == "__main__":
    for _ in range(2):
        with client_of(None, 1) as client:
            folder = client.submit(os.getenv, SCRATCH).result()
            print(folder, Path(folder).is_dir())
"""


def test_each_study_of_a_process_has_a_folder_that_goes_with_it(tmp_path: Path) -> None:
    script = tmp_path / "two.py"
    script.write_text(TWO_STUDIES)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (one, first), (two, second) = (line.split() for line in done.stdout.splitlines())
    assert first == second == "True" and one != two
    assert not Path(one).exists() and not Path(two).exists()


def test_a_worker_of_another_version_is_refused(client: Client) -> None:
    asked = study(vary={})
    source = CalculationSource(Parameters, square)
    engine = Engine(client, source, asked.figures, 2.0, "9.9.9")
    cases = [case_of(asked, cells_of(asked), 0, 0)]
    with pytest.raises(InputError, match=r"another version of the corridor than 9\.9\.9"):
        list(engine.results(lambda _: [cases.pop()] if cases else []))


def test_a_scheduler_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    source = CalculationSource(Parameters, square)
    with pytest.raises(InputError, match="--scheduler: 'tcp:nowhere'"):
        run_study(study(), source, tmp_path / "a", QUIET, "", where=Where("tcp:nowhere"))
    assert not (tmp_path / "a").exists()


def test_a_folder_in_which_a_study_writes_is_not_taken(tmp_path: Path, here: Where) -> None:
    out = tmp_path / "a"
    out.mkdir()
    held = os.open(out, os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_EX)
    with pytest.raises(InputError, match=r"--out: .*another study is writing there"):
        run(out, here)
    os.close(held)
    with alone_in(out):
        assert out.is_dir()
    assert not out.exists()  # nothing was written


def lose_the_scheduler() -> None:
    """Let a cluster end in the middle of a study; prints what is said of it."""
    asked = study(vary={})
    source = CalculationSource(Parameters, square)
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        client = Client(cluster)
        engine = Engine(client, source, asked.figures, 2.0, code_version())
        runs = iter(range(9))

        def more(count: int) -> list[Any]:
            run = next(runs)
            if run:
                cluster.close()
            return [case_of(asked, cells_of(asked), 0, run)]

        try:
            list(engine.results(more))
        except LostClusterError as lost:
            print(lost)
        client.close()


def test_a_scheduler_that_goes_is_told() -> None:
    # In a process of its own: the loop of a second cluster of one process did not always start.
    here = "tests.rail_corridor.study.test_engine"
    script = f"if __name__ == '__main__':\n    import {here} as here\n    here.lose_the_scheduler()"
    root = Path(__file__).parents[3]
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "go on with --resume" in done.stdout
