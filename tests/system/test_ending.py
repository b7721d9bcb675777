"""However a run ends, it leaves a report if it can, and nothing else."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from rail_corridor.run.exit_codes import HALF_GONE, UNSAFE
from rail_msgs_py.topics.tick import CLOCK, OBSERVED

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system


def test_a_signal_ends_everything_and_leaves_a_report(rail: Rail, listener: Listener) -> None:
    path, recording = rail.directory / "report.json", rail.directory / "run.mcap"
    clock = listener.listen(CLOCK)
    run = rail.start(
        *("run", "plain_line", "--rate", 5, "--processes", "site"),
        *("--report", path, "--record", recording),
    )
    # The report acknowledges what it has read: from then on it is connected.
    observed = listener.listen(OBSERVED)
    listener.until(lambda: observed)
    connected = len(clock)
    listener.until(lambda: len(clock) > connected + 30)
    run.send_signal(signal.SIGTERM)  # after SIGINT: `test_nothing_outlives_the_launcher`
    assert rail.finish(run) == 128 + signal.SIGTERM
    report = json.loads(path.read_text())
    assert report["complete"] is False
    assert 10 <= report["ticks"] < 500
    assert set(report["trains"]) == {"train_a"}
    assert not rail.processes()
    assert "Traceback" not in rail.errors(run)
    recorded = rail.again(recording)
    assert recorded["ticks"] == report["ticks"]
    # What was under way to the report when it ended is recorded all the same.
    assert recorded == report or report["missing_ticks"] > recorded["missing_ticks"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_nothing_outlives_the_launcher(
    rail: Rail,
    listener: Listener,
    wait_until: Callable[[Callable[[], Any]], Any],
    number: signal.Signals,
) -> None:
    recording = rail.directory / "run.mcap"
    observed = listener.listen(OBSERVED)
    run = rail.start("run", "plain_line", "--rate", 5, "--processes", "site", "--record", recording)
    wait_until(lambda: len(rail.processes()) >= 10 and len(rail.segments()) >= 9)
    # A recording has the ticks of its report, so that must have read some before it ends.
    listener.until(lambda: len(observed) > 1 and recording.stat().st_size > 300_000)
    segments = rail.segments()
    run.send_signal(number)
    run.wait()
    wait_until(lambda: not rail.processes())
    # The recorder, the last to go, has completed its file.
    report = rail.again(recording)
    assert report["ticks"] > 1 and not report["complete"]
    assert (report["wall_time_s"] is None) == (number == signal.SIGKILL)
    # What others had open up to the last moment goes with the next run.
    rail.report("plain_line", "--duration", 1, "--processes", "one")
    assert not rail.left_behind(segments)


def test_a_signal_while_it_connects_ends_it_too(rail: Rail, listener: Listener) -> None:
    run = rail.start("run", "plain_line", "--rate", 1, "--processes", "site")
    listener.until(lambda: len(rail.processes()) > 3)
    run.send_signal(signal.SIGTERM)
    assert rail.finish(run) == 128 + signal.SIGTERM
    assert not rail.processes()


@pytest.mark.parametrize("begun", [False, True], ids=["connecting", "running"])
def test_hundreds_of_nodes_in_one_process_end_at_once(
    rail: Rail, listener: Listener, *, begun: bool
) -> None:
    scenario = {
        "name": "long_line",
        "seed": 1,
        "duration_s": 300.0,
        "tracks": {"main": {"elements": [{"straight_m": 26_000.0}], "speed_limits": [[0, 80]]}},
        "stations": {"zone_length_m": 200.0},
        "trains": [
            {"name": f"t{number}", "route": ["main"], "start_m": 200.0 * number + 150.0}
            for number in range(100)
        ],
    }
    path, report = rail.directory / "long_line.yaml", rail.directory / "report.json"
    path.write_text(json.dumps(scenario))
    clock = listener.listen(CLOCK)
    run = rail.start("run", path, "--processes", "one", "--report", report)
    if begun:
        listener.until(lambda: len(clock) > 3)
    else:
        listener.until(lambda: listener.node.count_publishers("/diagnostics") > 20)
    spent_s = rail.cpu_s()
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT
    # Taking leave of all of them one by one takes five to twenty seconds, in which it computes.
    assert rail.cpu_s() - spent_s < 3.0
    assert json.loads(report.read_text())["nodes"] > 220
    assert not rail.processes()


@pytest.mark.parametrize(
    ("first", "second", "number", "code"),
    [
        ("wayside", "onboard", signal.SIGINT, 128 + signal.SIGINT),
        ("onboard", "wayside", signal.SIGTERM, 128 + signal.SIGTERM),
        ("onboard", "wayside", signal.SIGKILL, -signal.SIGKILL),
    ],
)
def test_the_halves_of_a_corridor_end_together(
    rail: Rail, listener: Listener, first: str, second: str, number: signal.Signals, code: int
) -> None:
    clock = listener.listen(CLOCK)
    arguments = ("run", "plain_line", "--rate", 5, "--processes", "site", "--timeout", 5, "--only")
    halves = {part: rail.start(*arguments, part) for part in (first, second)}
    # Each half looks for the other twice a second.
    listener.until(lambda: len(clock) > 30)
    asked_s = time.monotonic()
    halves[first].send_signal(number)
    assert rail.finish(halves[first]) == code
    assert rail.finish(halves[second]) == HALF_GONE
    assert time.monotonic() - asked_s < 20.0
    line = f"the {first} half has ended: so this one ends"
    assert line in rail.output(halves[second])


@pytest.mark.parametrize("part", ["onboard", "report"])
def test_a_part_whose_world_never_comes_ends(rail: Rail, part: str) -> None:
    run = rail.start("run", "plain_line", "--timeout", 1, "--only", part)
    assert rail.finish(run) == HALF_GONE
    rest = {"onboard": "the wayside half", "report": "the corridor itself"}[part]
    assert f"waiting for {rest}" in rail.output(run)
    assert f"{rest} has not come: so this one ends" in rail.output(run)


def test_a_run_in_which_trains_collide_ends_with_its_verdict_and_its_code(rail: Rail) -> None:
    scenario = {
        "name": "head_on",
        "duration_s": 40.0,
        "tracks": {"main": {"elements": [{"straight_m": 1500}]}},
        "stations": {"zone_length_m": 300},
        "trains": [
            {"name": "up", "route": ["main"], "start_m": 400},
            {"name": "down", "route": ["main"], "start_m": 1000, "direction": -1},
        ],
    }
    path = rail.directory / "head_on.yaml"
    path.write_text(json.dumps(scenario))
    run = rail.start("run", path, "--processes", "one")
    assert rail.finish(run) == UNSAFE
    last = rail.output(run).strip().splitlines()[-1]
    assert last.startswith("unsafe: collision of up and down at ")
