"""Studies of corridors: interrupted and gone on with, on one host and on several that die."""

from __future__ import annotations

import csv
import gc
import importlib
import signal
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from rail_corridor.loading.loader import builtin_scenarios, load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.study.corridor_run import run_corridor
from rail_corridor.yaml_file import load_yaml
from rail_msgs_py.node import CorridorMixin

from .waiting import until

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system
ROOT = Path(__file__).resolve().parents[2]
STUDY: dict[str, Any] = {
    "name": "noise",
    "scenario": "plain_line",
    "parameters": {"duration_s": 3},
    "vary": {"tick_s": [0.1, 0.2]},
    "draw": {"trains.0.start_m": {"uniform": [20, 60]}},
    "runs": 5,
    "figures": {
        "rmse_m": {"of": "trains.*.phase_ranging.rmse_m", "take": "max"},
        "ticks": {"over_runs": "sum"},
    },
}
RUNS = 10


@pytest.fixture
def study(rail: Rail) -> Path:
    """Return the file of a study of some short runs."""
    path = rail.directory / "noise.yaml"
    path.write_text(yaml.safe_dump(STUDY))
    return path


def rows_of(rail: Rail, *arguments: object) -> list[dict[str, str]]:
    """Return the rows of a study that goes to its end."""
    process = rail.start("study", *arguments)
    assert rail.finish(process) == 0, rail.errors(process)
    return written(rail.directory / "noise.study")


def written(folder: Path) -> list[dict[str, str]]:
    with (folder / "rows.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def runs_in(folder: Path) -> int:
    """Return how many runs a journal has."""
    journal = folder / "journal.jsonl"
    return len(journal.read_text().splitlines()) - 1 if journal.exists() else 0


def test_an_interrupted_study_goes_on_and_leaves_nothing_behind(
    rail: Rail, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = rail.directory / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    folder = rail.directory / "noise.study"
    # More runs than are wanted in the end: it is still at work when it is interrupted.
    process = rail.start("study", study, "--workers", 2, "--runs", 200)
    until(lambda: runs_in(folder) >= 3)
    segments = rail.segments()
    assert [*temporary.glob("rail_study_*")]
    process.send_signal(signal.SIGINT)
    assert rail.finish(process) == 130, rail.errors(process)
    assert "Traceback" not in rail.errors(process)
    assert 3 <= len(written(folder)) < 400
    assert " of 400 runs at most; go on with --resume" in rail.output(process)
    until(lambda: not rail.processes())
    assert not segments and not [*temporary.glob("rail_study_*")]
    rows = rows_of(rail, study, "--workers", 1, "--resume")
    assert len(rows) == RUNS
    # Each row is what a run by itself gives, whoever made it.
    one = rows[7]
    assert (one["tick_s"], one["seed"], one["ticks"]) == ("0.2", "3", "15")
    data = load_yaml(builtin_scenarios()["plain_line"])
    data |= {"tick_s": 0.2, "duration_s": 3, "seed": 3}
    data["trains"][0]["start_m"] = float(one["trains.0.start_m"])
    path = rail.directory / "one.yaml"
    path.write_text(yaml.safe_dump(data))
    report = rail.report(path)
    rmse = max(train["phase_ranging"]["rmse_m"] for train in report["trains"].values())
    assert float(one["rmse_m"]) == rmse


def test_a_worker_on_another_host_dies_and_the_study_is_complete(
    rail: Rail, study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    lossy_link = importlib.import_module("lossy_link")
    alone = rows_of(rail, study, "--workers", 2)
    folder = rail.directory / "apart"
    dask = [sys.executable, "-m", "distributed.cli"]
    address = "tcp://10.99.0.1:8786"
    started: list[subprocess.Popen[str]] = []

    def start(host: Any, *command: str) -> subprocess.Popen[str]:
        log = (rail.directory / f"host_{len(started)}").open("w")
        options = {"stdout": log, "stderr": log, "cwd": rail.directory, "env": rail.environment}
        started.append(host.start([*command], **options))
        return started[-1]

    try:
        with lossy_link.LossyLink(0.0, hosts=3) as link:
            head, *others = link.hosts
            start(head, *dask[:-1], f"{dask[-1]}.dask_scheduler", "--host", "10.99.0.1")
            workers = [
                start(host, *dask[:-1], f"{dask[-1]}.dask_worker", address, "--nthreads", "1")
                for host in others
            ]
            rail_command = [sys.executable, "-m", "rail_corridor.cli.main", "study", str(study)]
            process = start(head, *rail_command, "--scheduler", address, "--out", str(folder))
            until(lambda: runs_in(folder) >= 2 or process.poll() is not None)
            _kill_with_children(workers[0].pid)
            assert process.wait(timeout=90.0) == 0, (rail.directory / "host_3").read_text()
    except lossy_link.NoLinkError as error:
        pytest.skip(f"this machine permits no such network: {error}")
    finally:
        for each in started:
            each.kill()
            each.wait()
    assert written(folder) == alone and len(alone) == RUNS


def _kill_with_children(pid: int) -> None:
    """Kill a process, and first those that it has started."""
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in (task / "children").read_text().split():
            _kill_with_children(int(child))
    subprocess.run(["kill", "-9", str(pid)], check=True)


def test_nothing_of_a_run_stays_in_its_process() -> None:
    scenario = load_scenario("plain_line", overrides=Overrides(duration_s=1.0))

    def alive() -> list[Any]:
        gc.collect()
        return [each for each in gc.get_objects() if isinstance(each, CorridorMixin)]

    before = len(alive())
    for _ in range(2):
        run_corridor(scenario)
    assert len(alive()) == before
