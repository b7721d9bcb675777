"""Ends of units with clocks of their own, which are started anew: nonces, delays, drift, jumps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_msgs_py.train_radio.clock_offset import ClockOffset
from rail_msgs_py.train_radio.safe_frame import FrameKind, payload_of, read_header
from rail_msgs_py.train_radio.safe_result import Accepted, Greeted, Rejected, RejectionReason
from rail_msgs_py.train_radio.train_channel import (
    EndSettings,
    UnitChannel,
    controller_end,
    key_of,
    train_end,
)
from rail_msgs_py.train_radio.unit_clock import ClockFault, UnitClock

UP, DOWN = FrameKind.LOCATION_REPORT, FrameKind.MOVEMENT_AUTHORITY
KEY = "5a" * 32
SECOND = 1_000_000_000


class Link:
    """A train and its controller; frames of one tick come in the next, or later."""

    def __init__(
        self,
        tick_s: float = 0.25,
        train: Sequence[ClockFault] = (),
        controller: Sequence[ClockFault] = (),
    ) -> None:
        self.tick_s, self.tick_ns = tick_s, round(tick_s * SECOND)
        self.clocks = {"train": UnitClock(train), "controller": UnitClock(controller)}
        self.tick = 0
        self.late = {"train": 1, "controller": 1}
        self.sent: list[tuple[int, int, str, bytes]] = []
        self.ends: dict[str, UnitChannel] = {}
        self.start("train")
        self.start("controller")
        #: Tick, tick in which it was sealed, receiver and what became of each frame.
        self.opened: list[tuple[int, int, str, Accepted | Greeted | Rejected]] = []

    def start(self, name: str) -> None:
        """Switch an end on, or on anew."""
        make = train_end if name == "train" else controller_end
        self.ends[name] = make(EndSettings(KEY, 1, 7, self.tick_s, self.clocks[name]))

    def run(self, ticks: int, lost: float = 0.0, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        for _ in range(ticks):
            stamp_ns = self.tick * self.tick_ns
            for due, sealed, to, frame in [each for each in self.sent if each[0] == self.tick]:
                opened = self.ends[to].open(frame, stamp_ns)
                self.opened.append((due, sealed, to, opened))
            for name, to, kind in (("train", "controller", UP), ("controller", "train", DOWN)):
                frame = self.ends[name].seal(kind, b"content", stamp_ns)
                if rng.random() >= lost:
                    self.sent.append((self.tick + self.late[to], self.tick, to, frame))
            self.tick += 1

    def accepted(self, to: str, since: int = 0) -> list[tuple[float, Accepted]]:
        """True age and what was accepted."""
        return [
            ((tick - sealed) * self.tick_s, opened)
            for tick, sealed, name, opened in self.opened
            if name == to and tick >= since and isinstance(opened, Accepted)
        ]


DRIFTS = [(0.0, 0.0), (10.0, 200.0), (-10.0, -200.0)]


@pytest.mark.parametrize("tick_s", [0.1, 0.25, 1.0])
@pytest.mark.parametrize("train", DRIFTS)
@pytest.mark.parametrize("controller", DRIFTS)
def test_clocks_that_are_wrong_and_drift_cost_nothing(
    tick_s: float, train: tuple[float, float], controller: tuple[float, float]
) -> None:
    link = Link(tick_s, [ClockFault(0.0, *train)], [ClockFault(0.0, *controller)])
    link.run(400)
    for to in link.ends:
        accepted = link.accepted(to)
        assert len(accepted) >= 400 - 4
        for true_s, opened in accepted:
            # At least the true age, by whatever clock, and less than a thousandth more.
            assert true_s * (1 - 1e-9) <= opened.age_s < true_s + 2e-3 * tick_s + 3e-6
            assert opened.age_s - opened.doubt_s <= true_s


@settings(max_examples=40)
@given(
    st.floats(-10.0, 10.0),
    st.floats(-200.0, 200.0),
    st.floats(-10.0, 10.0),
    st.floats(-200.0, 200.0),
    st.integers(0, 1000),
)
def test_no_frame_passes_that_was_held_back_longer_than_the_limit(
    train_s: float, train_ppm: float, controller_s: float, controller_ppm: float, seed: int
) -> None:
    """Whatever the clocks: frames are held back a little more in every tick, and some are lost."""
    clocks = [ClockFault(0.0, train_s, train_ppm)], [ClockFault(0.0, controller_s, controller_ppm)]
    link = Link(0.25, *clocks)
    rng = np.random.default_rng(seed)
    link.run(20)
    for late in range(2, 12):
        link.late = {"train": late, "controller": int(rng.integers(1, 4))}
        link.run(10, lost=0.2, seed=seed + late)
    assert link.accepted("train")
    for to in link.ends:
        for true_s, opened in link.accepted(to):
            assert true_s <= 1.0 and true_s * (1 - 1e-9) <= opened.age_s <= 1.0
            assert opened.age_s - opened.doubt_s <= true_s


def test_delay_that_grows_slowly_is_not_taken_for_drift() -> None:
    """By a thousandth in a second, as a clock of 1000 ppm would: beyond what clocks may drift."""
    offset = ClockOffset(0, 2e-4)
    assert offset.learn(0, 0, 0)
    for second in range(1, 4000):
        sent_ns, late_ns = second * SECOND, second * SECOND // 1000
        # The peer hears at once and answers at once; its answers are held back.
        assert offset.learn(sent_ns, sent_ns, sent_ns + late_ns)
        age = offset.age(sent_ns, sent_ns + late_ns)
        assert age is not None and age.most_ns >= late_ns


@pytest.mark.parametrize("who", ["train", "controller"])
@pytest.mark.parametrize("jump_s", [-30.0, -2.0, 2.0, 30.0])
def test_a_clock_that_jumps_is_noticed_and_the_link_comes_back(who: str, jump_s: float) -> None:
    link = Link(0.25, **{who: [ClockFault(10.0, jump_s, 0.0)]})
    link.run(160)
    broken = [
        opened.reason
        for tick, _, _, opened in link.opened
        if 40 <= tick < 80 and isinstance(opened, Rejected)
    ]
    assert broken
    for to in link.ends:
        assert all(true_s <= opened.age_s <= 1.0 for true_s, opened in link.accepted(to))
        assert len(link.accepted(to, since=80)) == 80


def test_a_jump_of_the_peers_clock_is_named() -> None:
    link = Link(0.25, controller=[ClockFault(10.0, 2.0, 0.0)])
    link.run(44)
    reasons = [each[3].reason for each in link.opened if isinstance(each[3], Rejected)]
    assert RejectionReason.CLOCK_JUMPED in reasons


def test_a_jump_that_hides_a_delay_is_bounded_by_ones_own_clock() -> None:
    """The peer's clock jumps ahead by what its frames are held back from then on."""
    link = Link(0.25, controller=[ClockFault(10.0, 60.0, 0.0)])
    link.run(40)
    link.late["train"] = 1 + 240
    link.run(300)
    assert all(true_s <= 5.0 for true_s, _ in link.accepted("train"))


@pytest.mark.parametrize("who", [["train"], ["controller"], ["train", "controller"]])
def test_what_was_recorded_before_a_restart_is_of_no_use_after_it(who: list[str]) -> None:
    """All of it, at either end, in its order and at once, while the ends greet each other anew."""
    link = Link()
    link.run(12)
    recorded = [(to, frame) for _, _, to, frame in link.sent]
    for name in who:
        link.start(name)
    # Within the age limit, and long after it.
    for pause in (0, 1, 40):
        link.tick += pause
        for own in link.ends:
            link.ends[own].seal(UP if own == "train" else DOWN, b"", link.tick * link.tick_ns)
        for to, frame in recorded:
            if to in who:
                opened = link.ends[to].open(frame, link.tick * link.tick_ns)
                assert not isinstance(opened, Accepted)
                assert opened != Greeted(True)
                assert not link.ends[to].established
    before = link.tick + 30
    link.run(60)
    for to in link.ends:
        assert len(link.accepted(to, since=before)) >= 28


def test_no_two_starts_have_one_nonce_in_whatever_process() -> None:
    offers: set[bytes] = set()
    for make, kind in ((train_end, UP), (controller_end, DOWN)):
        for train in (1, 2):
            for tick in range(50):
                stamp_ns = tick * SECOND // 4
                # A new process has nothing but its parameters.
                frame = make(EndSettings(KEY, 1, train, 0.25)).seal(kind, b"", stamp_ns)
                offers.add(payload_of(frame)[:16])
                again = make(EndSettings(KEY, 1, train, 0.25)).seal(kind, b"", stamp_ns)
                assert again == frame  # the run is repeatable
    assert len(offers) == 2 * 2 * 50


@pytest.mark.parametrize(("tick_s", "oldest_ticks"), [(0.25, 4), (0.1, 10), (0.5, 3), (1.0, 3)])
def test_frames_may_be_three_ticks_old_or_a_second(tick_s: float, oldest_ticks: int) -> None:
    link = Link(tick_s)
    link.run(8)
    link.late["train"] = oldest_ticks
    link.run(3 * oldest_ticks)
    link.late["train"] = oldest_ticks + 1
    link.run(3 * oldest_ticks)
    # What clocks may have drifted meanwhile counts against the frame: one tick less is certain.
    late = [true_s for true_s, _ in link.accepted("train")]
    assert max(late, default=0.0) <= oldest_ticks * tick_s


@pytest.mark.parametrize(
    ("key", "reason"), [("ab", "16 bytes or more, got 1"), ("xyz", "hexadecimal digits")]
)
def test_a_key_that_is_none_is_refused(key: str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        key_of(key)
    with pytest.raises(ValueError, match=reason):
        train_end(EndSettings(key, 1, 7, 0.25))


def test_time_stamps_are_those_of_the_units_clock() -> None:
    clock = UnitClock([ClockFault(0.0, 5.0, 0.0), ClockFault(10.0, -5.0, 100.0)])
    end = train_end(EndSettings(KEY, 1, 7, 0.25, clock))
    seen = [read_header(end.seal(UP, b"", s * SECOND)).time_ns / 1e9 - 86_400 for s in (1, 11)]
    assert seen == pytest.approx([6.0, 6.0001], abs=1e-6)
