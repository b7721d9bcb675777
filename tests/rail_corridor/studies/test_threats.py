"""The threat campaign, short: nothing passes; and an oracle that sees what a weak end lets by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from rail_corridor.studies.threats import (
    LATENCY_S,
    MAX_AGE_S,
    MakeEnd,
    run_intruder_campaign,
    run_threat_campaign,
)
from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_world.train_radio.frame_threats import Threat

FRAMES = 2000
SECRET = b"the secret of weak ends"


def weak(name: str) -> type[SafeChannel]:
    """A channel that leaves out one of its checks."""
    passing = {"_genuine": True, "_untimely": None, "_misplaced": None}
    return type("Weak", (SafeChannel,), {name: lambda *_: passing[name]})


def test_no_threat_gets_anything_accepted() -> None:
    rows = run_threat_campaign(FRAMES)
    assert [row.threats for row in rows] == [t.value for t in Threat] + ["all together"]
    for row in rows:
        assert row.frames >= FRAMES and row.restarts > 5 and row.attacks > 0.2 * FRAMES
        assert not row.wrongly_accepted, row
        # An end that takes nothing would be safe too: most of what arrives untouched is taken.
        assert row.accepted > 0.55 * row.frames
        assert row.arrived == row.accepted + row.greeted + sum(row.rejected.values())


def test_without_threats_only_restarts_cost_frames() -> None:
    (row,) = run_threat_campaign(FRAMES, [[]])
    assert row.threats == "none" and not row.attacks and not row.wrongly_accepted
    assert row.accepted + row.greeted + row.rejected["unknown_session"] == row.arrived
    assert row.accepted > 0.93 * row.frames and row.reported_lost == 0


def test_a_row_depends_on_its_seed_alone() -> None:
    together = [list(Threat)]
    assert run_threat_campaign(600, together) == run_threat_campaign(600, together)
    assert run_threat_campaign(600, together) != run_threat_campaign(600, together, seed=2)


@pytest.mark.parametrize(
    ("left_out", "threat", "fault"),
    [
        ("_genuine", Threat.CORRUPTION, "not sealed by the peer for this end"),
        ("_genuine", Threat.INSERTION, "not sealed by the peer for this end"),
        ("_genuine", Threat.MASQUERADE, "not sealed by the peer for this end"),
        ("_misplaced", Threat.REPETITION, "accepted before, or out of order"),
        ("_misplaced", Threat.RESEQUENCING, "accepted before, or out of order"),
    ],
)
def test_the_oracle_sees_a_missing_check(left_out: str, threat: Threat, fault: str) -> None:
    channel = weak(left_out)

    def make(own: int, peer: int, kind: FrameKind, draw: Callable[[int], bytes]) -> SafeChannel:
        return channel(SECRET, own, peer, [kind], draw, max_age_s=MAX_AGE_S)

    (row,) = run_threat_campaign(FRAMES, [[threat]], make_end=make)
    assert row.wrongly_accepted[fault] > 0, row


@pytest.mark.parametrize("fixed", [False, True])
def test_nonces_alone_keep_out_what_was_recorded_before_a_restart(fixed: bool) -> None:
    """Neither age nor, after a restart, numbers tell: without new nonces the oracle sees it."""
    channel = weak("_untimely")

    def make(own: int, peer: int, kind: FrameKind, draw: Callable[[int], bytes]) -> SafeChannel:
        nonces = (lambda count: bytes([own]) * count) if fixed else draw
        return channel(SECRET, own, peer, [kind], nonces, max_age_s=MAX_AGE_S)

    (row,) = run_threat_campaign(FRAMES, [[Threat.REPETITION]], make_end=make)
    assert (row.wrongly_accepted["from before the receiver's start"] > 0) is fixed, row


def repeating(*, both: bool) -> MakeEnd:
    """Ends that draw the nonces of before at every start; all else is as it should be."""

    def make(own: int, peer: int, kind: FrameKind, draw: Callable[[int], bytes]) -> SafeChannel:
        repeated = both or own != 1
        nonces = np.random.default_rng([own, peer]).bytes if repeated else draw
        settings = {"max_age_s": MAX_AGE_S, "least_delay_s": LATENCY_S}
        return SafeChannel(SECRET, own, peer, [kind], nonces, **settings)

    return make


def test_who_plays_to_an_end_how_it_began_before_is_not_believed() -> None:
    row = run_intruder_campaign("directed_replay", 10 * FRAMES)
    assert row.restarts > 500 and row.attacks > 5000
    assert not row.wrongly_accepted, row
    assert row.accepted > 0.5 * row.frames


@pytest.mark.parametrize("both", [False, True])
def test_nonces_that_repeat_at_a_restart_are_found_out(both: bool) -> None:
    row = run_intruder_campaign("directed_replay", FRAMES, make_end=repeating(both=both))
    assert row.wrongly_accepted["session from a recorded greeting"] > 0, row
    if both:
        assert row.wrongly_accepted["from before the receiver's start"] > 0, row


def test_frames_that_are_held_back_by_more_and_more_are_refused_in_time() -> None:
    row = run_intruder_campaign("growing_delay", 10 * FRAMES)
    assert row.attacks >= row.arrived > 0.9 * row.frames and row.restarts > 50
    assert not row.wrongly_accepted, row
    assert row.accepted > 0.3 * row.frames and row.rejected["too_old"] > 0.05 * row.frames


def trusting(own: int, peer: int, kind: FrameKind, draw: Callable[[int], bytes]) -> SafeChannel:
    """An end that looks at no age."""
    return weak("_untimely")(SECRET, own, peer, [kind], draw, max_age_s=MAX_AGE_S)


def test_the_oracle_sees_frames_that_are_too_old() -> None:
    row = run_intruder_campaign("growing_delay", FRAMES, make_end=trusting)
    assert row.wrongly_accepted["too old"] > 0, row


def test_a_campaign_sends_something() -> None:
    with pytest.raises(ValueError, match="frames must be 1 or more, got 0"):
        run_threat_campaign(0)
