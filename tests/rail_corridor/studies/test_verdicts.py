"""Verdicts of studies: what must not happen in a run is a figure that is not what it must be.

The reports are those of made-up runs, so that the places at which studies read them are those at
which they are written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rail_corridor.studies.kills import (
    DURATION_S,
    TICK_S,
    KillParameters,
    draw_kill,
    look_at_kill,
)
from rail_corridor.studies.link_margin.runs import look_at_link_margin
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.studies.safety.judgement import judge_safety
from rail_corridor.studies.threats import run_threat_campaign
from rail_corridor.study.journal import Entry
from rail_corridor.study.model import Study
from rail_corridor.study.sources import CalculationSource, Drawn, found
from rail_corridor.study.study_file import load_study
from rail_corridor.study.summary import violations_of
from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.safe_result import Accepted, Opened

from ..run_builder import RunBuilder

DRAWN = draw_kill(KillParameters(), 1)


def shipped(name: str) -> Study:
    """Return a study that comes with the corridor."""
    study, _ = load_study(name, FOLDER, GENERATORS, CALCULATIONS)
    return study


def judged(
    name: str, report: dict[str, Any], drawn: Mapping[str, Any] | None = None
) -> tuple[dict[str, float | None], set[str]]:
    """Return the figures of a run of a study, and those that are not what they must be."""
    study = shipped(name)
    figures = found(study.figures, report | {"drawn": drawn or {}})
    entry = Entry(0, 0, 1, {}, {}, figures, None, 0.0)
    return figures, {violation.figure for violation in violations_of([entry], study.figures)}


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


def test_a_good_passing_violates_nothing() -> None:
    figures, violated = judged("handover", passing())
    assert (figures["crossings"], figures["made"], violated) == (1, 1, set())


@pytest.mark.parametrize("what", HANDOVER)
def test_what_must_not_happen_at_a_handover_is_a_violation(what: str) -> None:
    make, counts = HANDOVER[what]
    figures, violated = judged("handover", make())
    assert {name: figures[name] for name in counts} == counts
    assert violated == {*counts}


def test_a_run_without_a_crossing_or_with_a_dead_node_says_nothing_of_handovers() -> None:
    report = passing()
    report["failures"] = [{"node": "/wayside/wrs1"}]
    assert judged("handover", report)[1] == {"given_up"}
    nowhere = RunBuilder("plain_line", 9).moves("train_a", np.full(9, 50.0), 0.0)
    report = nowhere.ranged("train_a", np.full(9, 50.0), channel=np.full(9, 1.0)).report()
    assert "crossings" in judged("handover", report)[1]


# Kills -----------------------------------------------------------------------------------

TICKS = round(DURATION_S / TICK_S)


def killed(change: Callable[[RunBuilder], RunBuilder] = lambda run: run) -> dict[str, Any]:
    """Return the report of a run of which the dead node was missed."""
    run = change(RunBuilder("moving_block", TICKS))
    report = run.report()
    report["failures"] = [{"node": DRAWN.facts["node"]}]
    return report | {"judged": judge_safety(DRAWN, run.scenario, run.data)}


def judged_kill(report: dict[str, Any]) -> tuple[dict[str, float | None], set[str]]:
    return judged("kills", report, {**look_at_kill(DRAWN, report), **report["judged"]})


def creeping(run: RunBuilder) -> RunBuilder:
    return (
        run.moves("third", 500.0, 0.1).believed("third", 500.0, end_m=499.0).given("third", 499.0)
    )


KILLS: dict[str, tuple[Callable[[RunBuilder], RunBuilder], float]] = {
    "passed_authority_ticks": (creeping, TICKS),
    "overspeed_s": (lambda run: run.moves("second", 850.0, 23.0), DURATION_S),
    "collisions": (
        lambda run: run.moves("second", 1200.0 - 117.9).believed("second", 1200.0 - 117.9),
        1.0,
    ),
    "passed_tails": (lambda run: run.rear_taken("second", 850.0 - 117.9), TICKS),
    "least_gap_m": (
        lambda run: run.moves("second", 1200.0 - 118.0).believed("second", 1200.0 - 118.0),
        0.0,
    ),
    "forged_accepted": (lambda run: run.given("fourth", 4000.0), TICKS),
    "mislocated_ticks": (lambda run: run.believed("fourth", 152.0, 1.5), TICKS),
}


def test_a_run_in_which_a_dead_node_harmed_nobody_is_no_violation() -> None:
    figures, violated = judged_kill(killed())
    assert violated == set()
    assert figures["least_gap_m"] == 350.0 - 118.0


#: What the report counts and the truth says, too.
TOGETHER = {
    "passed_authority_ticks": {"passed_ends"},
    "overspeed_s": {"too_fast_s"},
    "collisions": {"least_gap_m"},
}


@pytest.mark.parametrize("what", KILLS)
def test_what_must_not_happen_after_a_kill_is_a_violation(what: str) -> None:
    change, value = KILLS[what]
    figures, violated = judged_kill(killed(change))
    assert figures[what] == pytest.approx(value)
    assert violated == {what, *TOGETHER.get(what, ())}


@pytest.mark.parametrize("change", [{"complete": False}, {"ticks": 100}])
def test_a_run_that_stopped_early_did_not_go_on(change: dict[str, Any]) -> None:
    assert judged_kill(killed() | change)[1] == {"went_on"}


def test_a_dead_node_that_nobody_missed_was_not_noticed() -> None:
    assert judged_kill(killed() | {"failures": [{"node": "/another"}]})[1] == {"noticed"}


# The link margin -------------------------------------------------------------------------


def test_the_study_of_the_link_margin_counts_ticks_past_an_end() -> None:
    told = dict.fromkeys(("frame_loss_told", "brakings_per_h_told"), 0.0)
    for change, count in ((lambda run: run, 0), (creeping, TICKS)):
        report = killed(change)
        drawn = told | look_at_link_margin(Drawn({}), report)
        figures, violated = judged("link_margin", report, drawn)
        assert figures["passed_authority_ticks"] == count
        assert violated == ({"passed_authority_ticks"} if count else set())


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


def test_what_was_wrongly_accepted_is_a_violation(monkeypatch: pytest.MonkeyPatch) -> None:
    study = shipped("threats")
    source = CALCULATIONS["threats"]
    assert isinstance(source, CalculationSource)
    for wrong in (False, True):
        if wrong:
            anything = Accepted(FrameKind.LOCATION_REPORT, b"", 0.0, 1, 0, 0, 0)
            monkeypatch.setattr(SafeChannel, "open", lambda *_, said=anything: said)
        _, figures = source.run({"threat": "delay", "frames": 300}, 1, study.figures)
        entry = Entry(0, 0, 1, {}, {}, figures, None, 0.0)
        violated = {each.figure for each in violations_of([entry], study.figures)}
        assert violated == ({"wrongly_accepted"} if wrong else set())
