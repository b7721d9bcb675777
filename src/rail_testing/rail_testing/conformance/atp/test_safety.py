"""Safety of train protection: when it must brake, and what it must not believe."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from math import isnan
from typing import Any

import pytest

from rail_msgs_py.topics.train_radio import AUTHORITY, RADIO_TELEGRAMS
from rail_msgs_py.topics.world import ODOMETER
from rail_msgs_py.train_radio.movement_authority import MovementAuthority
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_testing.conformance.atp.kind import KIND
from rail_testing.conformance.bench import Bench

REQUIREMENT = pytest.mark.requirement


def deafen(bench: Bench) -> None:
    """Let no telegram come through any more."""

    def empty(message: Any) -> Any:
        return Telegrams(Telegrams.from_msg(message).stamp_ns, ()).to_msg()

    bench.corridor.intercept(RADIO_TELEGRAMS.name(train=bench.place), empty)


def timeout_s(bench: Bench) -> float:
    """Age at which an authority is void [s]."""
    found = KIND.parameter(bench, "authority_timeout_s")
    return 3.0 if isnan(found) else found


def alter_authorities(monkeypatch: pytest.MonkeyPatch, **changes: Any) -> None:
    """Let the zone controller write something else into its telegrams, and seal it as ever."""
    write = MovementAuthority.to_bytes
    monkeypatch.setattr(
        MovementAuthority, "to_bytes", lambda authority: write(replace(authority, **changes))
    )


@REQUIREMENT("IEEE 1474.1 6.1.5, authority not received [M]")
def test_without_an_authority_it_brakes(bench: Bench) -> None:
    """As long as no telegram came a brake is demanded, and the train does not move."""
    c = bench.start()
    deafen(bench)
    where_m = c.truth(bench.place).front_m

    def moves() -> str:
        if not KIND.brakes(bench):
            return "demands no brake, though it has never received an authority"
        off_m = c.truth(bench.place).front_m - where_m
        return f"the train has moved by {off_m:.1f} m without an authority" if off_m > 1.0 else ""

    bench.run(15.0, moves)


@REQUIREMENT("IEEE 1474.1 6.1.5, loss of communication [M]")
@REQUIREMENT("EN 50159 7.3.3, time-out [M]")
def test_an_authority_that_is_too_old_is_void(bench: Bench) -> None:
    """Once the newest authority is older than its time-out a brake is demanded."""
    c = bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(10.0)
    deafen(bench)
    begun_s, allowed_s = c.time_s, timeout_s(bench)

    def too_old() -> str:
        age_s = c.time_s - begun_s
        if age_s <= allowed_s + 2.0 * bench.tick_s or KIND.brakes(bench):
            return ""
        return (
            f"its newest authority is at least {age_s:.1f} s old, {allowed_s:g} s are allowed, "
            "and it demands no brake"
        )

    bench.run(allowed_s + 10.0, too_old)


@REQUIREMENT("EN 50159 7.3.1, repetition; 7.3.6, delay [M]")
def test_recorded_telegrams_are_no_authority(bench: Bench) -> None:
    """Telegrams of ten seconds ago, with the time of now, do not keep a train running."""
    c = bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    recorded: deque[Any] = deque(maxlen=max(2, round(10.0 / bench.tick_s)))
    replaying = False

    def replay(message: Any) -> Any:
        view = Telegrams.from_msg(message)
        if not replaying:
            recorded.append(view.frames)
            return message
        frames = recorded[0]
        recorded.rotate(-1)
        return Telegrams(view.stamp_ns, frames).to_msg()

    c.intercept(RADIO_TELEGRAMS.name(train=bench.place), replay)
    bench.run(12.0)
    replaying = True
    bench.run(timeout_s(bench) + 2.0 * bench.tick_s)

    def obeys() -> str:
        return "" if KIND.brakes(bench) else "runs on telegrams that were recorded before"

    bench.run(8.0, obeys)


@REQUIREMENT("IEEE 1474.1 6.1.3, safe train separation [M]")
@REQUIREMENT("DESIGN, ATP: the front never passes the end of authority")
def test_it_stops_before_its_end_of_authority(bench: Bench) -> None:
    """The train ahead stops: the one behind comes close, and its front passes no end."""
    c = bench.start(faults=[{"kind": "train_stop", "train": "first", "from_s": 25, "to_s": 200}])
    ends = c.topic(AUTHORITY.name(train=bench.place))

    def passed() -> str:
        known = [view.end_of_authority_m for view in ends.newest(20)]
        furthest_m = max((float(end) for end in known if not isnan(end)), default=None)
        front_m = c.truth(bench.place).front_m
        if furthest_m is None or front_m <= furthest_m:
            return ""
        return f"the front is at {front_m:.1f} m, past the end of authority at {furthest_m:.1f} m"

    bench.run(110.0, passed)
    speed_mps = c.truth(bench.place).speed_mps
    if speed_mps > 0.5:
        bench.refuse(f"runs at {speed_mps:.1f} m/s behind a train that has stood for a minute")


@REQUIREMENT("IEEE 1474.1 6.1.4, overspeed protection [M]")
def test_a_train_that_is_too_fast_is_braked(bench: Bench) -> None:
    """The wheels turn faster than what is permitted: the brake is demanded in the same tick."""
    c = bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(20.0)
    counted = ODOMETER.index["distance_m"], ODOMETER.index["speed_mps"]
    extra_m = 0.0

    def faster(message: Any) -> Any:
        nonlocal extra_m
        data = message.data
        extra_m += 8.0 * bench.tick_s
        data[1 + counted[0]] += extra_m
        data[1 + counted[1]] += 8.0
        message.data = data
        return message

    c.intercept(ODOMETER.name(train=bench.place), faster)
    bench.run(bench.tick_s, claims=False)
    command = KIND.command(bench)
    speed_mps = c.topic(ODOMETER.name(train=bench.place)).latest.speed_mps
    if not KIND.brakes(bench):
        bench.refuse(
            f"the odometer says {speed_mps:.1f} m/s, {command.permitted_mps:.1f} m/s are "
            "permitted, and it demands no brake"
        )


@REQUIREMENT("IEEE 1474.1 6.1.6, emergency stop [M]")
def test_an_emergency_stop_is_obeyed(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Genuine telegrams with the order to stop: the emergency brake, until the train stands."""
    c = bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(20.0)
    alter_authorities(monkeypatch, emergency_stop=True)
    bench.run(3.0 * bench.tick_s)

    def obeyed() -> str:
        moving = c.truth(bench.place).speed_mps > 0.5
        emergency = bool(KIND.command(bench).emergency_brake)
        return (
            "was told to stop at once and does not demand the emergency brake"
            if (moving and not emergency)
            else ""
        )

    bench.run(25.0, obeyed)
    if c.truth(bench.place).speed_mps > 0.1:
        bench.refuse("does not stand 25 s after an emergency stop")


@REQUIREMENT("EN 50159 7.3.7, masquerade: source and destination [M]")
def test_authorities_for_others_are_not_obeyed(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Genuinely sealed, but for another train: as good as none."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(5.0)
    alter_authorities(monkeypatch, train=77)
    bench.run(timeout_s(bench) + 3.0 * bench.tick_s)

    def obeys() -> str:
        return "" if KIND.brakes(bench) else "runs on authorities that are for train 77"

    bench.run(5.0, obeys)
