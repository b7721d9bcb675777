"""The report of a recording: that of the run, figure for figure, and of what there is of it."""

from __future__ import annotations

import io
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from rail_corridor.errors import InputError
from rail_corridor.recording.frames import Attachment
from rail_corridor.report.from_recording import show_report
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.world import STATE

TICKS, NODES, PROCESSES = 60, 9, 3


@pytest.fixture
def run(made_up: Callable[..., Any]) -> Any:
    """Return a run that came to its end."""
    return made_up()


def shown(path: Path, json_path: Path | None = None) -> str:
    console = Console(width=200, file=io.StringIO(), record=True)
    assert show_report(path, json_path, console) == 0
    return console.export_text()


def test_it_is_that_of_the_run_figure_for_figure(run: Any, tmp_path: Path) -> None:
    run.write()
    assert run.reported() == run.report
    # Nothing of this is empty.
    assert run.report["ticks"] == TICKS
    assert run.report["wall_time_s"] == 2.625
    assert run.report["trains"]["train_a"]["phase_ranging"]["rmse_m"] > 0.0
    assert len(run.report["events"]) == 6
    assert [f["time_s"] for f in run.report["failures"]] == [3.0]
    path = tmp_path / "again.json"
    text = shown(run.path, path)
    assert json.loads(path.read_text()) == run.report
    assert "not what the run itself reported" not in text
    assert "cut short" not in text


def test_the_order_of_several_senders_changes_nothing(run: Any) -> None:
    # Each topic keeps its order, as it does in a pipe; the topics are mixed anew.
    rng = random.Random(8)
    by_name: dict[str, list[Any]] = {}
    for each in run.said:
        by_name.setdefault(each.name, []).append(each)
    mixed = []
    while by_name:
        name = rng.choice(sorted(by_name))
        mixed.append(by_name[name].pop(0))
        if not by_name[name]:
            del by_name[name]
    assert mixed != run.said
    run.write(mixed)
    assert run.reported() == run.report


def test_of_a_run_that_was_stopped_both_leave_out_the_last_tick(
    made_up: Callable[..., Any],
) -> None:
    run = made_up(ticks=41, ending=40)
    assert (run.report["ticks"], run.report["complete"]) == (40, False)
    run.write()
    assert run.reported() == run.report


def test_without_its_end_it_is_the_report_of_what_is_there(run: Any) -> None:
    run.write(whole=False)
    report = run.reported()
    assert (report["ticks"], report["complete"]) == (TICKS - 1, False)
    assert (report["wall_time_s"], report["real_time_factor"]) == (None, None)
    assert (report["nodes"], report["processes"]) == (NODES, PROCESSES)
    run.path.write_bytes(run.path.read_bytes()[:-200])
    assert run.reported() == report
    text = shown(run.path)
    assert text.count("is cut short at byte") == 1
    assert f"{TICKS - 1} ticks" in text


def test_cut_anywhere_it_reports_or_says_why_not(run: Any) -> None:
    run.write()
    whole = run.path.read_bytes()
    ticks = []
    for size in range(0, len(whole), len(whole) // 15):
        run.path.write_bytes(whole[:size])
        try:
            ticks.append(run.reported()["ticks"])
        except InputError as error:
            assert str(error).startswith(str(run.path))
            assert not ticks
    assert ticks == sorted(ticks)
    assert len(ticks) > 3


def test_a_figure_that_differs_is_pointed_out(run: Any) -> None:
    run.report["trains"]["train_a"]["distance_m"] += 1.0
    run.write()
    assert "not what the run itself reported: trains.train_a.distance_m" in shown(run.path)


def nothing(said: list[Any]) -> list[Any]:
    return said


def other_type(said: list[Any]) -> list[Any]:
    return [said[0]._replace(topic=CLOCK, raw=said[1].raw), *said[1:]]


def short(said: list[Any]) -> list[Any]:
    return [said[0]._replace(raw=said[0].raw[:30]), *said[1:]]


def late(said: list[Any]) -> list[Any]:
    raw = bytearray(said[0].raw)
    width = len(STATE.columns) + 1
    raw[-8 * width :] = b"\x00\x00\x00\x00\x00\x00\xf0\x7e" * width  # a stamp beyond all ages
    return [said[0]._replace(raw=bytes(raw)), *said[1:]]


@pytest.mark.parametrize(
    ("change", "files", "told"),
    [
        (other_type, None, "/world/state: 'rosgraph_msgs/msg/Clock': must be of type"),
        (short, None, "/world/state: .*: the message at 0 s cannot be read"),
        (late, None, "/world/state: .*: the message at .* s cannot be read"),
        (nothing, [], "holds no scenario.yaml"),
        (nothing, [Attachment("scenario.yaml", "", b"name: 7")], "in its scenario.yaml"),
    ],
)
def test_what_is_no_run_is_one_line(
    run: Any, change: Callable[[list[Any]], list[Any]], files: list[Attachment] | None, told: str
) -> None:
    run.write(change(run.said), files=files)
    with pytest.raises(InputError, match=told) as caught:
        run.reported()
    assert str(caught.value).startswith(f"{run.path}: ")
    assert "\n" not in str(caught.value)
