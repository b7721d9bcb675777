"""Supervision by the codes: closed forms, and trains that never pass what they may not."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_onboard.track_code.supervision import (
    TRIP_SPEEDS_300_KMH,
    CodeSupervision,
    Delays,
    SupervisionOutput,
    Thresholds,
)
from rail_signals.track_code.scales import SPEEDS_KMH, deceleration_mps2
from rail_wayside.track_code.code_logic import Block, CodeLogic

KMH = 1.0 / 3.6
TICK_S = 0.1
DELAYS = Delays()
LIMITS = Thresholds()
TABLE = SPEEDS_KMH


def code(
    now_kmh: float, end_kmh: float, length_m: float = 1000.0, permil: float = 0.0
) -> dict[str, int]:
    return {
        "speed": TABLE.index(now_kmh) << 4 | TABLE.index(end_kmh),
        "gradient": round(permil / 5.0) + 10,
        "block_length": round(length_m / 25.0),
        "network": 0,
    }


OPEN = code(160.0, 160.0)


@dataclass
class Ride:
    """Feeds a supervision tick by tick."""

    supervision: CodeSupervision = field(default_factory=CodeSupervision)
    time_s: float = 0.0
    at_m: float = 0.0

    def tick(
        self, fields: dict[str, int] | None, carrier_hz: float | None, speed_mps: float = 0.0
    ) -> SupervisionOutput:
        self.time_s += TICK_S
        self.at_m += speed_mps * TICK_S
        return self.supervision.update(
            self.time_s, self.at_m, speed_mps, fields=fields, carrier_hz=carrier_hz
        )

    def run(
        self,
        seconds: float,
        fields: dict[str, int] | None,
        carrier_hz: float | None,
        speed_mps: float,
    ) -> SupervisionOutput:
        for _ in range(max(1, round(seconds / TICK_S))):
            out = self.tick(fields, carrier_hz, speed_mps)
        return out


def entered(fields: dict[str, int], speed_mps: float = 30.0, **more: float) -> Ride:
    """Return a ride that has entered a block of ``fields`` at odometer 0, the old one open."""
    ride = Ride(CodeSupervision(**more))  # type: ignore[arg-type]
    ride.run(0.5, OPEN, 1700.0, 0.0)
    ride.run(0.5, OPEN, 1700.0, speed_mps)
    ride.at_m = -DELAYS.notice_s * speed_mps  # so that the worst entrance is at 0
    for _ in range(10):
        ride.tick(OPEN, 1700.0)
        ride.at_m = 0.0
    ride.tick(fields, 2300.0)
    return ride


# The curve --------------------------------------------------------------------------------


@pytest.mark.parametrize("permil", [-30.0, 0.0, 20.0])
@pytest.mark.parametrize(("now", "end"), [(130.0, 0.0), (160.0, 80.0), (300.0, 265.0)])
def test_the_permitted_speed_leaves_just_the_braking_distance(
    now: float, end: float, permil: float
) -> None:
    length_m, error = 1500.0, 0.02
    ride = entered(code(now, end, length_m, permil))
    b, t = deceleration_mps2(0.5, permil), DELAYS.brake_s
    a = DELAYS.traction_mps2 + max(0.0, -9.80665e-3 * permil)
    on_curve = 0
    for at_m in range(0, 1500, 50):
        ride.at_m = float(at_m)
        permitted = ride.tick(code(now, end, length_m, permil), 2300.0).permitted_mps
        assert end * KMH - 1e-9 <= permitted <= now * KMH + 1e-9
        if not end * KMH + 1e-9 < permitted < now * KMH - 1e-9:
            continue
        on_curve += 1
        # Too fast by the margin, traction through the dead time, then the brake.
        trigger = permitted + LIMITS.service_over_mps
        fastest = trigger + a * t
        needed_m = 0.5 * (trigger + fastest) * t + (fastest**2 - (end * KMH) ** 2) / (2.0 * b)
        assert needed_m == pytest.approx(length_m - at_m * (1.0 + error), abs=1e-6)
    assert on_curve > 3
    ride.at_m = 1600.0
    assert ride.tick(code(now, end, length_m, permil), 2300.0).permitted_mps == pytest.approx(
        end * KMH
    )


def test_a_fall_that_takes_the_brake_allows_the_end_speed_only() -> None:
    ride = entered(code(80.0, 40.0, 1500.0, -50.0))
    assert ride.tick(code(80.0, 40.0, 1500.0, -50.0), 2300.0).permitted_mps == pytest.approx(
        40.0 * KMH
    )


def test_where_the_entrance_is_not_known_the_end_speed_holds() -> None:
    assert Ride().run(1.0, code(160.0, 60.0), 1700.0, 0.0).permitted_mps == pytest.approx(
        60.0 * KMH
    )


def test_a_new_block_is_obeyed_from_its_first_code() -> None:
    ride = entered(code(130.0, 80.0, 500.0))
    ride.run(26.0, code(130.0, 80.0, 500.0), 2300.0, 20.0)
    waiting = ride.run(2.0, None, 1700.0, 20.0)
    assert waiting.permitted_mps == pytest.approx(80.0 * KMH)
    assert not waiting.service_brake
    assert ride.tick(code(130.0, 130.0), 1700.0, 20.0).permitted_mps == pytest.approx(130.0 * KMH)


def test_the_entrance_is_where_the_old_carrier_was_last_surely_heard() -> None:
    found = {}
    for silent_s in (0.0, 1.0):
        ride = entered(OPEN)
        ride.run(26.0, OPEN, 2300.0, 40.0)
        if silent_s:
            ride.run(silent_s, None, None, 40.0)
        found[silent_s] = ride.tick(code(160.0, 0.0), 1700.0, 40.0).permitted_mps
    run_m = {silent_s: 40.0 * (silent_s + DELAYS.notice_s + TICK_S) for silent_s in found}
    for silent_s, permitted in found.items():
        ride = entered(code(160.0, 0.0))
        ride.at_m = run_m[silent_s]
        assert permitted == pytest.approx(ride.tick(code(160.0, 0.0), 2300.0).permitted_mps)


def test_a_localizer_counts_where_it_knows_both_places() -> None:
    """Wheels that slide count nothing; half-widths at entrance and place come off what is left."""
    fields = code(80.0, 0.0, 500.0)
    speed_mps, half_m, step_s = 20.0, 3.0, 0.1

    def permitted(knows: Callable[[float], bool]) -> float:
        supervision = CodeSupervision()
        at_m = -100.0
        for tick in range(140):
            at_m += speed_mps * step_s
            entered = at_m > 0.0
            out = supervision.update(
                tick * step_s,
                0.0,  # the wheels stand still
                speed_mps,
                fields=fields if entered else OPEN,
                carrier_hz=2300.0 if entered else 1700.0,
                located_m=(at_m - half_m, at_m + half_m) if knows(at_m) else None,
            )
        return out.permitted_mps

    ride = entered(fields, speed_mps, odometer_error=0.0)
    notice_m = DELAYS.notice_s * speed_mps
    ride.at_m += 178.0 + 2.0 * half_m + notice_m
    wanted = ride.tick(fields, 2300.0, 0.0).permitted_mps
    assert permitted(lambda at_m: True) == pytest.approx(wanted, abs=0.2)
    blind = permitted(lambda at_m: False)
    assert blind > permitted(lambda at_m: True) + 1.0
    # Known at the entrance only, or here only: the odometer counts.
    assert permitted(lambda at_m: at_m < 50.0) == permitted(lambda at_m: at_m > 50.0) == blind


@pytest.mark.parametrize("doubt_mps", [0.0, 1.0, 4.0])
def test_a_train_that_is_faster_than_its_wheels_say_still_stops_in_its_block(
    doubt_mps: float,
) -> None:
    """At the worst by physics: the doubt stays until it stands, it gathers until brakes act."""
    b, t, a = 0.5, DELAYS.brake_s, DELAYS.traction_mps2
    fields, left_m = code(80.0, 0.0, 500.0), 500.0  # `entered` is at the entrance at the worst
    used_m = 0.0
    for speed_mps in [0.1 * step for step in range(10, 220)]:
        ride = entered(fields, speed_mps, odometer_error=0.0)
        out = ride.supervision.update(
            ride.time_s + TICK_S,
            ride.at_m,
            speed_mps,
            fields=fields,
            carrier_hz=2300.0,
            fastest_mps=speed_mps,
            doubt_mps=doubt_mps,
        )
        if out.service_brake:
            break
        fastest = speed_mps + doubt_mps + a * t
        needed_m = (fastest - 0.5 * a * t) * t + fastest**2 / (2.0 * b)
        assert needed_m < left_m
        used_m = needed_m
    # And it is let run nearly as far as that.
    assert used_m > 0.9 * left_m


def test_crosstalk_makes_no_entrance() -> None:
    """A change before the coded end, and back, leaves the train at the worst place."""
    fields = code(160.0, 40.0, 1500.0)
    ride = entered(fields)
    before = ride.run(2.0, fields, 2300.0, 20.0)
    assert before.permitted_mps > 100.0 * KMH
    ride.run(0.3, None, 1700.0, 20.0)
    assert ride.tick(fields, 2300.0, 20.0).permitted_mps == pytest.approx(40.0 * KMH)


def test_another_block_on_the_same_carrier_makes_no_entrance() -> None:
    ride = entered(code(160.0, 40.0, 1500.0))
    assert ride.tick(code(160.0, 40.0, 1000.0), 2300.0).permitted_mps == pytest.approx(40.0 * KMH)


# Loss of the code -------------------------------------------------------------------------


def test_without_any_code_a_train_may_not_move() -> None:
    out = Ride().run(5.0, None, 1700.0, 0.0)
    assert (out.service_brake, out.emergency_brake, out.reason) == (True, False, "no valid code")
    assert out.permitted_mps == 0.0


def test_the_response_time_itself_is_forgiven() -> None:
    ride = entered(OPEN)
    ride.run(1.0, OPEN, 2300.0, 40.0)
    assert not ride.run(DELAYS.response_s - 0.1, None, 2300.0, 40.0).service_brake
    assert ride.run(0.3, None, 2300.0, 40.0).reason == "no valid code"


@pytest.mark.parametrize("permil", [-30.0, 0.0, 30.0])
def test_loss_of_the_code_brings_the_train_to_a_stand(permil: float) -> None:
    fields = code(160.0, 160.0, 1500.0, permil)
    v = 140.0 * KMH
    ride = entered(fields, v)
    ride.run(1.0, fields, 2300.0, v)
    lost_at_m, speed = ride.at_m, v
    b, delay = deceleration_mps2(0.5, permil), deque([False] * 9)
    for _ in range(5000):
        out = ride.tick(None, None, speed)
        assert not out.emergency_brake  # the service brake does what it should
        delay.append(out.service_brake)
        speed = max(0.0, speed - b * TICK_S) if delay.popleft() else speed
        if speed == 0.0:
            break
    run_m = ride.at_m - lost_at_m
    expected_m = v * (DELAYS.response_s + DELAYS.brake_s) + v**2 / (2.0 * b)
    assert run_m == pytest.approx(expected_m, abs=v * 3 * TICK_S)
    assert ride.run(5.0, None, None, 0.0).service_brake
    assert not ride.tick(fields, 2300.0, 0.0).service_brake


def test_a_new_carrier_does_not_release_a_train_that_has_lost_its_code() -> None:
    ride = entered(OPEN)
    ride.run(26.0, OPEN, 2300.0, 40.0)
    assert ride.run(3.0, None, None, 40.0).service_brake
    assert ride.tick(None, 1700.0, 30.0).service_brake
    assert not ride.tick(OPEN, 1700.0, 30.0).service_brake


def test_flicker_does_not_put_off_the_loss() -> None:
    ride = entered(OPEN)
    ride.run(26.0, OPEN, 2300.0, 40.0)
    for tick in range(40):
        out = ride.tick(None, (1700.0, 2300.0)[tick % 2], 40.0)
    assert out.reason == "no valid code"


# Brakes and releases ----------------------------------------------------------------------


def test_warning_service_and_emergency_brake_act_one_after_the_other() -> None:
    permitted = 160.0 * KMH
    found = []
    for over in (0.0, 0.3, 1.0, 2.5):
        out = entered(OPEN).tick(OPEN, 2300.0, permitted + over)
        found.append((out.warning, out.service_brake, out.emergency_brake))
    assert found == [
        (False, False, False), (True, False, False), (True, True, False), (True, True, True),
    ]  # fmt: skip


def test_the_service_brake_is_released_well_below_the_permitted_speed() -> None:
    ride, permitted = entered(OPEN), 160.0 * KMH
    assert ride.tick(OPEN, 2300.0, permitted + 1.0).service_brake
    assert ride.tick(OPEN, 2300.0, permitted - 0.4).service_brake
    assert not ride.tick(OPEN, 2300.0, permitted - 0.6).service_brake


def test_the_emergency_brake_is_released_at_a_stand_only() -> None:
    ride = entered(OPEN)
    assert ride.tick(OPEN, 2300.0, 50.0).emergency_brake
    assert ride.tick(OPEN, 2300.0, 5.0).emergency_brake
    assert not ride.tick(OPEN, 2300.0, 0.0).service_brake


def test_a_service_brake_that_fails_is_backed_by_the_emergency_brake() -> None:
    ride = entered(OPEN)
    ride.run(1.0, OPEN, 2300.0, 40.0)
    assert ride.run(12.0, None, 2300.0, 40.0).emergency_brake


def test_to_pass_a_stop_trips_the_train() -> None:
    ride = entered(code(60.0, 0.0, 500.0))
    ride.run(40.0, code(60.0, 0.0, 500.0), 2300.0, 15.0)
    ride.run(2.0, code(60.0, 0.0, 500.0), 2300.0, 1.0)
    out = ride.tick(None, 1700.0, 1.0)
    assert (out.emergency_brake, out.reason) == (True, "stop passed")
    assert ride.run(3.0, code(60.0, 60.0), 1700.0, 1.0).emergency_brake
    assert not ride.tick(code(60.0, 60.0), 1700.0, 0.0).service_brake


def test_trip_speeds_of_the_300_family() -> None:
    limits = Thresholds(trip_kmh=TRIP_SPEEDS_300_KMH)
    for permitted, trip in ((0, 35), (80, 90), (160, 170), (220, 235), (270, 285), (300, 315)):
        assert limits.emergency_mps(permitted * KMH) == pytest.approx(trip * KMH)
    assert limits.emergency_mps(120 * KMH) == pytest.approx(130 * KMH)
    assert limits.emergency_mps(320 * KMH) == pytest.approx(335 * KMH)


def test_without_an_odometer_the_emergency_brake_is_applied() -> None:
    assert entered(OPEN).tick(OPEN, 2300.0, math.nan).emergency_brake


def test_a_step_back_in_time_forgets_everything() -> None:
    ride = entered(OPEN)
    ride.time_s = -100.0
    assert ride.tick(None, 2300.0, 0.0).reason == "no valid code"


@pytest.mark.parametrize(
    "make",
    [
        lambda: CodeSupervision(guaranteed_service_mps2=0.0),
        lambda: CodeSupervision(odometer_error=-0.1),
        lambda: Thresholds(warn_over_mps=1.0),
        lambda: Thresholds(trip_kmh=((80.0, 70.0),)),
        lambda: Delays(window_s=-1.0),
    ],
)
def test_bad_parameters_are_refused(make: object) -> None:
    with pytest.raises(ValueError):
        make()  # type: ignore[operator]


CODES = st.builds(
    code,
    st.sampled_from(TABLE),
    st.sampled_from(TABLE),
    st.integers(0, 63).map(lambda n: 25.0 * n),
    st.integers(-10, 5).map(lambda n: 5.0 * n),
)


@settings(max_examples=60)
@given(
    st.lists(
        st.tuples(
            st.none() | CODES,
            st.sampled_from([None, 1700.0, 2300.0]),
            st.floats(0.0, 90.0),
            st.integers(1, 40),
        ),
        max_size=20,
    )
)
def test_brakes_are_never_released_above_the_permitted_speed(
    feed: list[tuple[dict[str, int] | None, float | None, float, int]],
) -> None:
    ride, again = Ride(), Ride()
    braking, valid_s = True, -math.inf
    for fields, carrier_hz, speed, ticks in feed:
        for _ in range(ticks):
            out = ride.tick(fields, carrier_hz, speed)
            assert out == again.tick(fields, carrier_hz, speed)
            if fields is not None and carrier_hz is not None:
                valid_s = ride.time_s
            assert out.permitted_mps >= 0.0
            assert out.service_brake or not out.emergency_brake
            assert bool(out.reason) == out.service_brake
            if braking and not out.service_brake:
                assert out.permitted_mps > 0.0
                assert speed <= out.permitted_mps
                assert ride.time_s - valid_s <= 2.0 * DELAYS.response_s + TICK_S
            if not out.service_brake:
                assert speed <= out.permitted_mps + LIMITS.service_over_mps
            braking = out.service_brake


# With the wayside: trains on a line -------------------------------------------------------


@dataclass
class Line:
    """A point mass on a line of circuits, its antenna, its receiver and its brake."""

    blocks: list[Block]
    occupied: list[bool]
    braking_mps2: float = 0.5
    odometer: float = 1.0
    window_s: float = 2.5
    late_s: float = 0.2
    lost: tuple[tuple[float, float], ...] = ()
    greedy: bool = True

    def run(self, seconds: float) -> list[tuple[float, float, float, SupervisionOutput]]:
        """Return (position, speed, end speed of the block's code, output) of every tick."""
        ends, at = [], 0.0
        for block in self.blocks:
            at += block.length_m
            ends.append(at)
        codes = CodeLogic(self.blocks, braking_mps2=self.braking_mps2).all_fields(self.occupied)
        supervision = CodeSupervision(guaranteed_service_mps2=self.braking_mps2)
        brake = deque([True] * (round(DELAYS.brake_s / TICK_S) - 1))
        x = v = 0.0
        index, since_s = 0, 0.0
        log = []
        for tick in range(round(seconds / TICK_S)):
            time_s = tick * TICK_S
            while index < len(ends) - 1 and x >= ends[index]:
                index, since_s = index + 1, time_s
            deaf = any(begin <= time_s < end for begin, end in self.lost)
            noticed = index - (1 if index and time_s - since_s < self.late_s else 0)
            carrier_hz = None if deaf else (1700.0, 2300.0)[noticed % 2]
            clear_s = max([since_s, *(end for _, end in self.lost if end <= time_s)])
            hears = not deaf and time_s - clear_s >= self.window_s
            out = supervision.update(
                time_s, x * self.odometer, v,
                fields=codes[index] if hears else None, carrier_hz=carrier_hz,
            )  # fmt: skip
            log.append((x, v, TABLE[codes[index]["speed"] & 15] * KMH, out))
            brake.append(out.service_brake)
            permil = self.blocks[index].gradient_permil
            if brake.popleft():
                a = -deceleration_mps2(self.braking_mps2, permil)
            elif self.greedy or v < out.permitted_mps - 0.1:
                a = DELAYS.traction_mps2 + min(0.0, -9.80665e-3 * permil) * (permil > 0)
                a += max(0.0, -9.80665e-3 * permil)
            else:
                a = 0.0
            faster = max(0.0, v + a * TICK_S)
            if not self.greedy and not out.service_brake:
                faster = min(faster, out.permitted_mps)
            x += 0.5 * (v + faster) * TICK_S
            v = faster
        return log


LINES = st.lists(
    st.builds(
        Block,
        st.floats(300.0, 1500.0),
        st.sampled_from([60.0, 80.0, 120.0, 200.0, 300.0]).map(lambda kmh: kmh * KMH),
        st.floats(-25.0, 20.0),
    ),
    min_size=4,
    max_size=9,
)


@settings(max_examples=20)
@given(
    LINES,
    st.integers(2, 9),
    st.floats(0.985, 1.015),
    st.floats(1.6, 2.5),
    st.floats(0.0, 0.3),
    st.lists(st.tuples(st.floats(20.0, 150.0), st.floats(0.5, 20.0)), max_size=2),
    st.booleans(),
)
def test_no_train_passes_a_stop_or_an_end_speed(
    blocks: list[Block],
    taken: int,
    odometer: float,
    window_s: float,
    late_s: float,
    lost: list[tuple[float, float]],
    greedy: bool,
) -> None:
    """Whatever the driver does, and wherever the code is lost on the way."""
    taken = min(taken, len(blocks))
    occupied = [index == taken for index in range(len(blocks))]
    line = Line(
        blocks, occupied, 0.5, odometer, window_s, late_s,
        tuple((begin, begin + length) for begin, length in lost), greedy,
    )  # fmt: skip
    log = line.run(300.0)
    stop_m = sum(block.length_m for block in blocks[: taken - 1])
    ends, at = [], 0.0
    for block in blocks:
        at += block.length_m
        ends.append(at)
    assert max(x for x, *_ in log) <= stop_m
    for (x, _, end, _), (further, v, _, _) in pairwise(log):
        if any(x < border <= further for border in ends):
            fall = max(-block.gradient_permil for block in blocks)
            a = DELAYS.traction_mps2 + max(0.0, 9.80665e-3 * fall)
            margin = LIMITS.service_over_mps + a * (DELAYS.brake_s + TICK_S) if greedy else 0.2
            assert v <= end + margin


def test_a_driver_who_keeps_to_the_permitted_speed_is_never_braked() -> None:
    """The wayside's reaction time and margin are those that the train takes."""
    blocks = [Block(500.0, 80.0 * KMH)] * 4 + [Block(1500.0, 320.0 * KMH)] * 26
    log = Line(blocks, [False] * 30, greedy=False).run(900.0)
    assert max(v for _, v, _, _ in log) > 200.0 * KMH
    stop_m = sum(block.length_m for block in blocks[:-1])
    assert log[-1][0] > stop_m - 60.0
    started = next(n for n, (*_, out) in enumerate(log) if not out.service_brake)
    braked = [x for x, _, _, out in log[started:] if out.service_brake]
    assert all(x > stop_m - 60.0 for x in braked)


# Whose code it is ------------------------------------------------------------------------


def named(identity: int, now_kmh: float = 80.0) -> dict[str, int]:
    return code(now_kmh, now_kmh) | {"network": identity}


def test_a_code_out_of_sequence_is_not_obeyed_but_at_a_stand() -> None:
    ride = Ride()
    for _ in range(50):
        ride.tick(named(3, 40.0), 1700.0, 10.0)
    # The next circuit is dead; the one after it, of the old carrier, leaks through.
    out = [ride.tick(named(6, 130.0), 1700.0, 10.0) for _ in range(40)]
    assert out[0].permitted_mps == pytest.approx(40.0 * KMH)
    assert out[-1].reason == "no valid code"
    stands = [ride.tick(named(6, 130.0), 1700.0, 0.0) for _ in range(40)]
    assert not stands[-1].service_brake


def test_the_next_circuit_is_obeyed_after_a_change_of_carrier() -> None:
    ride = Ride()
    ride.tick(named(3, 40.0), 1700.0, 10.0)
    assert ride.tick(named(5, 60.0), 1700.0, 10.0).permitted_mps == pytest.approx(40.0 * KMH)
    ride.tick(None, 2300.0, 10.0)
    assert ride.tick(named(5, 60.0), 2300.0, 10.0).permitted_mps == pytest.approx(60.0 * KMH)
