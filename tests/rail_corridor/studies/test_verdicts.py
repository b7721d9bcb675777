"""Verdicts of campaigns: what must not happen in a run is a violation of its row, and of the whole.

The reports are those of made-up runs, so that the names by which campaigns read them are the
names by which they are written.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from rich.console import Console

from rail_corridor.cli.studies import campaign
from rail_corridor.studies import handover, kills, threat_table
from rail_corridor.studies.handover import HandoverRow, print_rows
from rail_corridor.studies.handover_scenarios import Situation
from rail_corridor.studies.kill_scenarios import DURATION_S, TICK_S, KillCase, draw_case
from rail_corridor.studies.kills import KillRow, kill_campaign, row_of
from rail_corridor.studies.link_margin.points import Point, aggregate
from rail_corridor.studies.link_margin.theory import LinkPrediction
from rail_corridor.studies.threat_table import threat_campaign
from rail_corridor.studies.threats import CampaignRow, run_threat_campaign
from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.safe_result import Accepted, Opened

from ..run_builder import RunBuilder

CASE = draw_case(1)
SITUATION = Situation("plain", "running", 80.0)


def quiet() -> Console:
    return Console(width=160, record=True, file=io.StringIO())


# Handover --------------------------------------------------------------------------------


def passing(channels: Any = None, error_m: Any = 0.0, track: str = "main") -> dict[str, Any]:
    """Return the report of a train that passes the station at 200 m."""
    way_m = np.arange(170.0, 260.0, 2.0)
    run = RunBuilder("plain_line", len(way_m)).moves("train_a", way_m, 20.0)
    right = np.where(way_m >= 200.0, 3.0, 1.0)
    channel = right if channels is None else channels(way_m, right)
    return run.ranged("train_a", way_m + error_m, track=track, channel=channel).report()


HANDOVER: dict[str, tuple[Callable[[], dict[str, Any]], dict[str, int]]] = {
    "missed": (lambda: passing(lambda way_m, _: np.full(len(way_m), 1.0)), {"missed": 1}),
    "wrong": (
        lambda: passing(lambda way_m, right: np.where(way_m > 250, 1.0, right)),
        {"wrong": 1},
    ),
    "misleading": (lambda: passing(error_m=2.3), {"misleading_ticks": 45}),
    "wrong track": (
        lambda: passing(track="elsewhere"),
        {"wrong_track_ticks": 45, "misleading_ticks": 45},
    ),
}


def test_a_good_run_violates_nothing() -> None:
    row = HandoverRow(SITUATION)
    for _ in range(2):
        row.add(passing())
    assert (row.runs, row.crossings, row.made, row.violations) == (2, 2, 2, 0)
    assert row.bad_seeds == []


@pytest.mark.parametrize("what", HANDOVER)
def test_what_must_not_happen_at_a_handover_is_counted(what: str) -> None:
    make, counts = HANDOVER[what]
    row = HandoverRow(SITUATION)
    row.add(passing())
    row.add(make())
    row.add(make())
    assert {name: getattr(row, name) for name in counts} == {n: 2 * c for n, c in counts.items()}
    assert row.violations == 2 * sum(counts.values())
    assert row.bad_seeds == [7, 7]
    console = quiet()
    print_rows([row], console)
    assert "look at seeds 7, 7" in console.export_text()


@pytest.mark.parametrize(("what", "code"), [(None, 0), *((what, 1) for what in HANDOVER)])
def test_the_handover_campaign_ends_with_its_verdict(
    monkeypatch: pytest.MonkeyPatch, what: str | None, code: int
) -> None:
    def rows(*_: Any) -> Iterator[HandoverRow]:
        row = HandoverRow(SITUATION)
        row.add(passing() if what is None else HANDOVER[what][0]())
        yield row

    monkeypatch.setattr(handover, "run_campaign", rows)
    with pytest.raises(typer.Exit) as ended:
        campaign("handover", crossings=1, runs=1, frames=1, seed=1, json=None)
    assert ended.value.exit_code == code


# Kills -----------------------------------------------------------------------------------

TICKS = round(DURATION_S / TICK_S)


def killed(change: Callable[[RunBuilder], RunBuilder] = lambda run: run) -> dict[str, Any]:
    """Return the report of a run of which the dead node was missed."""
    report = change(RunBuilder("moving_block", TICKS)).report()
    report["failures"] = [{"node": CASE.kill.node}]
    return report


def creeping(run: RunBuilder) -> RunBuilder:
    return (
        run.moves("third", 500.0, 0.1).believed("third", 500.0, end_m=499.0).given("third", 499.0)
    )


KILLS: dict[str, tuple[Callable[[RunBuilder], RunBuilder], str, float]] = {
    "passed its end of authority": (creeping, "passed_authority", TICKS),
    "overspeed": (lambda run: run.moves("second", 850.0, 23.0), "overspeed_s", DURATION_S),
    "touched another train": (
        lambda run: run.moves("second", 1200.0 - 118.0).believed("second", 1200.0 - 118.0),
        "least_gap_m",
        0.0,
    ),
    "authority that nobody gave": (
        lambda run: run.given("fourth", 4000.0),
        "forged_accepted",
        TICKS,
    ),
    "wrong place believed": (
        lambda run: run.believed("fourth", 152.0, 1.5),
        "mislocated",
        TICKS,
    ),
}


def test_a_run_in_which_a_dead_node_harmed_nobody_is_no_violation() -> None:
    row = row_of(CASE, killed())
    assert row.violations == ()
    assert row.least_gap_m == 350.0 - 118.0


@pytest.mark.parametrize("what", KILLS)
def test_what_must_not_happen_after_a_kill_is_a_violation(what: str) -> None:
    change, name, value = KILLS[what]
    row = row_of(CASE, killed(change))
    assert getattr(row, name) == pytest.approx(value)
    assert row.violations == (what,)


def test_a_run_that_stopped_early_did_not_go_on() -> None:
    report = killed() | {"complete": False}
    assert row_of(CASE, report).violations == ("did not go on",)


@pytest.mark.parametrize(("what", "code"), [(None, 0), *((what, 1) for what in KILLS)])
def test_the_kill_campaign_ends_with_its_verdict(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, what: str | None, code: int
) -> None:
    def run_case(case: KillCase) -> KillRow:
        report = killed() if what is None else killed(KILLS[what][0])
        report["failures"] = [{"node": case.kill.node}]
        return row_of(case, report)

    monkeypatch.setattr(kills, "run_case", run_case)
    console = quiet()
    assert kill_campaign(1, 1, console, tmp_path / "rows.json") == code
    assert (what or "safe") in console.export_text()


# The link margin -------------------------------------------------------------------------


def test_the_sweep_counts_ticks_past_an_end() -> None:
    prediction = LinkPrediction(12.0, 0.1, 0.2, 3.0)
    for change, count in ((lambda run: run, 0), (creeping, 2 * TICKS)):
        reports = [killed(change), killed(change)]
        assert aggregate(Point("mrc", 3.0), reports, prediction).passed_authority == count


# Threats ---------------------------------------------------------------------------------


class _Altering(SafeChannel):
    """An end that takes a frame for another than it is."""

    def __init__(self, what: str, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._what = what

    def open(self, frame: bytes, time_ns: int) -> Opened:
        opened = super().open(frame, time_ns)
        if not isinstance(opened, Accepted):
            return opened
        if self._what == "payload":
            return replace(opened, payload=bytes([opened.payload[0] ^ 1]) + opened.payload[1:])
        other = {
            FrameKind.LOCATION_REPORT: FrameKind.MOVEMENT_AUTHORITY,
            FrameKind.MOVEMENT_AUTHORITY: FrameKind.LOCATION_REPORT,
        }
        return replace(opened, kind=other[opened.kind])


@pytest.mark.parametrize("what", ["payload", "kind"])
def test_the_oracle_sees_other_content_than_was_sealed(what: str) -> None:
    def make(own: int, peer: int, kind: FrameKind, draw: Callable[[int], bytes]) -> SafeChannel:
        return _Altering(what, bytes(range(32)), own, peer, [kind], draw)

    (row,) = run_threat_campaign(300, [[]], make_end=make)
    assert set(row.wrongly_accepted) == {"other content than was sealed"}
    assert row.accepted == 0 and sum(row.wrongly_accepted.values()) > 200


@pytest.mark.parametrize(("wrong", "code"), [(0, 0), (1, 1)])
def test_the_threat_campaign_ends_with_its_verdict(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, wrong: int, code: int
) -> None:
    row = CampaignRow("delay", frames=10, accepted=9)
    row.rejected["too_old"] += 3
    if wrong:
        row.wrongly_accepted["too old"] += wrong
    monkeypatch.setattr(threat_table, "run_threat_campaign", lambda *_, **__: [row])
    console, path = quiet(), tmp_path / "rows.json"
    assert threat_campaign(10, 1, console, path) == code
    line = next(line for line in console.export_text().splitlines() if "delay" in line)
    assert line.strip("│ ").split("│")[-1].strip() == str(wrong)
    (written,) = json.loads(path.read_text())
    assert written["rejected"] == {"too_old": 3}
    assert written["wrongly_accepted"] == ({"too old": wrong} if wrong else {})
