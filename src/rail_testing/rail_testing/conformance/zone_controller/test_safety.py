"""Safety of the zone controller: no stretch twice, nothing without reports, nothing forged."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rail_msgs_py.topics.train_radio import BACKBONE_UP, REPORTS, UP_TELEGRAMS
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.zone_controller.kind import KIND

REQUIREMENT = pytest.mark.requirement


def intercept_reports(bench: Bench, function: Any) -> None:
    """Let a function change the telegrams that come from trains."""
    for name, topic in bench.ports.inputs.items():
        if topic in (UP_TELEGRAMS, BACKBONE_UP):
            bench.corridor.intercept(name, function)


def no_frames(message: Any) -> Any:
    """Nothing has come."""
    return Telegrams(Telegrams.from_msg(message).stamp_ns, ()).to_msg()


def need_radio(bench: Bench) -> None:
    """Leave out what is about authorities where there are none."""
    if not KIND.bases(bench):
        pytest.skip("the scenario has no base station: no authorities")


@REQUIREMENT("IEEE 1474.1 6.1.3, safe train separation [M]")
def test_no_stretch_is_given_to_two_trains(bench: Bench) -> None:
    """Trains close up on one that stops: no authority reaches beyond the rear of the one ahead."""
    bench.start(faults=[{"kind": "train_stop", "train": "first", "from_s": 30, "to_s": 90}])
    need_radio(bench)
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(110.0)


@REQUIREMENT("IEEE 1474.1 6.2.1, authorities follow from reported positions [M]")
def test_without_reports_there_is_no_authority(bench: Bench) -> None:
    """No telegram of a train comes through from the start: no train is let run."""
    c = bench.start()
    need_radio(bench)
    intercept_reports(bench, no_frames)

    places_m = {train: c.truth(train).front_m for train in bench.parameters["trains"]}

    def moves() -> str:
        for train, place_m in places_m.items():
            if KIND.authority(bench, train).accepted:
                return f"has accepted a report of {train}; none was sent"
            if abs(c.truth(train).front_m - place_m) > 1.0:
                return f"lets {train} run, which has never reported"
        return ""

    bench.run(20.0, moves)


@REQUIREMENT("IEEE 1474.1 6.1.5, loss of communication [M]")
def test_a_train_that_falls_silent_is_not_driven_into(bench: Bench) -> None:
    """Reports cease in mid-run, while trains roll on: no authority reaches into any of them."""
    bench.start()
    need_radio(bench)
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(20.0)
    intercept_reports(bench, no_frames)
    bench.run(30.0)
    intercept_reports(bench, None)
    bench.run_until_working(KIND.recovers_within_s, "after reports have come again")
    bench.run(20.0)


@REQUIREMENT("EN 50159 7.3.5, corruption; 7.3.7, masquerade [M]")
def test_forged_reports_are_refused(bench: Bench) -> None:
    """Frames with a bit flipped, and frames at random: no report is taken from them."""
    c = bench.start()
    need_radio(bench)
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(5.0)
    generator = np.random.default_rng(6)

    def forge(message: Any) -> Any:
        view, frames = Telegrams.from_msg(message), []
        for slot, frame in view.frames:
            bit = int(generator.integers(8 * len(frame)))
            changed = bytearray(frame)
            changed[bit // 8] ^= 1 << bit % 8
            frames += [(slot, bytes(changed)), (slot, generator.bytes(len(frame)))]
        return Telegrams(view.stamp_ns, tuple(frames)).to_msg()

    intercept_reports(bench, forge)

    def taken() -> str:
        for train in bench.parameters["trains"]:
            view = c.topic(REPORTS.name(train=train)).latest
            rows = getattr(view, "rows", (view,))
            if rows:
                return f"takes a report of {train} from a forged frame"
        return ""

    bench.run(20.0, taken)
