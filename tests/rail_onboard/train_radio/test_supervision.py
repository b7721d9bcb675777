"""Supervision by authorities: closed forms, and trains that never pass the end of theirs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import pytest

from rail_onboard.braking_curve import GuaranteedBraking
from rail_onboard.gradient_profile import GradientProfile
from rail_onboard.track_code.supervision import SupervisionOutput, Thresholds
from rail_onboard.train_radio.supervision import AuthoritySupervision, ReceivedAuthority
from rail_onboard.train_radio.train_location import NOWHERE, Location

LENGTH_M = 100.0
MARGIN_M = 10.0
LIMITS = Thresholds()
OVER = LIMITS.service_over_mps
BRAKING = GuaranteedBraking()
FAR = ReceivedAuthority(0.0, 5000.0, 20.0)
#: The curve to the end alone: the danger point is far.
HERE = replace(FAR, overlap_m=500.0)


def at(front_m: float, uncertainty_m: float = 0.0) -> Location:
    return Location(front_m, uncertainty_m, True)


def permitted(authority: ReceivedAuthority, location: Location, direction: int = 1) -> float:
    supervision = AuthoritySupervision(LENGTH_M, direction=direction, margin_m=MARGIN_M)
    return supervision.update(0.0, location, 0.0, authority=authority).permitted_mps


@dataclass
class Ride:
    """Feeds a supervision; every tick brings a fresh authority unless told otherwise."""

    supervision: AuthoritySupervision = field(
        default_factory=lambda: AuthoritySupervision(LENGTH_M, margin_m=MARGIN_M)
    )
    time_s: float = 0.0

    def tick(
        self,
        speed_mps: float = 0.0,
        location: Location = at(0.0),  # noqa: B008
        authority: ReceivedAuthority | None = FAR,
        *,
        after_s: float = 0.5,
        age_s: float = 0.0,
    ) -> SupervisionOutput:
        self.time_s += after_s
        if authority is not None:
            authority = replace(authority, sealed_s=self.time_s - age_s)
        return self.supervision.update(self.time_s, location, speed_mps, authority=authority)


def flags(out: SupervisionOutput) -> tuple[bool, bool, bool]:
    return out.warning, out.service_brake, out.emergency_brake


# The curves -------------------------------------------------------------------------------


def test_the_permitted_speed_leaves_just_the_way_to_stop_before_the_end() -> None:
    for left_m in (0.5, 3.0, 20.0, 100.0, 250.0):
        found = permitted(HERE, at(5000.0 - MARGIN_M - left_m - 3.0, 3.0))
        fastest = found + OVER + 0.5 * 1.0
        needed_m = 0.5 * (found + OVER + fastest) * 1.0 + fastest**2 / (2.0 * 0.7)
        rolling_m = OVER + 0.25 + (OVER + 0.5) ** 2 / 1.4
        assert 0.0 < found < 20.0
        # The driver is told one second before the service brake is to act.
        assert needed_m + found * 1.0 == pytest.approx(left_m + rolling_m)
        assert needed_m <= left_m + MARGIN_M


def test_the_permitted_speed_is_continuous_and_zero_from_the_margin_on() -> None:
    places = [4500.0 + 0.1 * n for n in range(5100)]
    speeds = [permitted(HERE, at(x, 2.0)) for x in places]
    steepest = 0.1 / (2.0 + (OVER + 0.5) / 0.7)  # 1 / (D'(m) + t_d) for each 0.1 m
    for one, other in pairwise(speeds):
        assert 0.0 <= one - other <= steepest + 1e-9
    stop_m = 5000.0 - MARGIN_M - 2.0
    assert permitted(HERE, at(stop_m - 1e-6, 2.0)) > 0.0
    assert all(v < 1e-9 for x, v in zip(places, speeds, strict=True) if x >= stop_m)


@pytest.mark.parametrize("direction", [1, -1])
def test_the_limits_under_the_whole_train_and_the_curve_to_the_next_one(direction: int) -> None:
    steps = ((direction * 1000.0, 10.0), (direction * 1500.0, 30.0))
    authority = ReceivedAuthority(0.0, direction * 9000.0, 25.0, steps)

    def at_s(s: float) -> float:
        return permitted(authority, at(direction * s, 5.0), direction)

    assert at_s(0.0) == 25.0
    for s in (600.0, 700.0, 800.0):
        fastest = at_s(s) + OVER + 0.5
        needed_m = fastest - 0.25 + (fastest**2 - 10.0**2) / 1.4 + at_s(s) * 1.0
        assert needed_m == pytest.approx(1000.0 - (s + 5.0))
    for s in (994.0, 996.0, 1300.0, 1500.0, 1604.0):
        assert at_s(s) == pytest.approx(10.0)
    assert at_s(1605.0) == 30.0


def test_a_fall_and_the_error_of_the_speed_count_at_both_ends() -> None:
    steep = GuaranteedBraking(gradients=GradientProfile([(0.0, -30.0)]), speed_error=0.02)
    b, a = 0.7 - 0.2941995, 0.5 + 0.2941995
    v = 1.02 * 15.0
    assert steep.stopping_m(15.0) == pytest.approx(v + 0.5 * a + (v + a) ** 2 / (2.0 * b))
    assert steep.stopping_m(15.0, emergency=True) == pytest.approx(
        v + 0.5 * a + (v + a) ** 2 / (2.0 * (b + 0.2))
    )
    assert steep.speed_mps(steep.stopping_m(15.0)) == pytest.approx(15.0)


# Brakes and releases ----------------------------------------------------------------------


def test_warning_service_and_emergency_brake_act_one_after_the_other() -> None:
    found = [flags(Ride().tick(20.0 + over)) for over in (0.3, 1.0, 2.5)]
    assert found == [(True, True, False), (True, True, False), (True, True, True)]
    ride = Ride()
    assert flags(ride.tick(0.0)) == (False, False, False)
    assert flags(ride.tick(20.0)) == (False, False, False)
    assert flags(ride.tick(20.3)) == (True, False, False)
    assert ride.tick(20.8).reason == "too fast"
    assert ride.tick(19.6).service_brake
    assert not ride.tick(19.4).service_brake


def test_the_emergency_brake_is_released_at_a_stand_only() -> None:
    ride = Ride()
    assert ride.tick(25.0).emergency_brake
    assert ride.tick(5.0).emergency_brake
    assert flags(ride.tick(0.0)) == (False, False, False)


def test_the_emergency_curve_to_the_end_itself() -> None:
    limit = ReceivedAuthority(0.0, 1000.0, 3.0)
    needed_m = 3.0 + 0.25 + 3.5**2 / 1.8
    late = Thresholds(emergency_over_mps=99.0)  # leaves the curve alone
    for short_m, expected in ((-0.01, False), (0.01, True)):
        ride = Ride(AuthoritySupervision(LENGTH_M, margin_m=MARGIN_M, thresholds=late))
        out = ride.tick(3.0, at(1000.0 - needed_m + short_m - 4.0, 4.0), limit)
        assert out.emergency_brake is expected
    ride = Ride()
    assert ride.tick(0.2, at(1000.0, 0.1), limit).reason == "end passed"
    assert ride.tick(0.0, at(1000.0, 0.1), limit).emergency_brake
    assert not ride.tick(0.0, at(1000.0, 0.1)).service_brake


def test_a_train_at_its_end_is_held_until_there_is_a_start_worth_it() -> None:
    ride = Ride()
    ride.tick(0.0)
    here = at(5000.0 - MARGIN_M - 1.0, 1.0)
    out = ride.tick(0.0, here)
    assert (flags(out), out.reason) == ((True, True, False), "end of authority")
    for end_m, expected in ((5000.5, True), (5003.0, False)):
        assert ride.tick(0.0, here, replace(FAR, end_m=end_m)).service_brake is expected


def test_the_uncertainty_may_cover_the_end_of_a_train_that_stands() -> None:
    out = Ride().tick(0.0, at(4995.0, 8.0))
    assert (flags(out), out.reason) == ((True, True, False), "end of authority")


def test_an_emergency_stop_is_obeyed_until_it_is_taken_back_at_a_stand() -> None:
    ride, stop = Ride(), replace(FAR, emergency_stop=True)
    ride.tick(0.0)
    out = ride.tick(10.0, authority=stop)
    assert (out.emergency_brake, out.reason) == (True, "emergency stop")
    assert ride.tick(5.0).emergency_brake
    assert ride.tick(0.0, authority=stop).emergency_brake
    assert not ride.tick(0.0).service_brake


# What is not known ------------------------------------------------------------------------


def test_without_an_authority_a_train_may_not_move() -> None:
    out = Ride().tick(0.0, authority=None)
    assert (flags(out), out.permitted_mps, out.reason) == ((True, True, False), 0, "no authority")


@pytest.mark.parametrize(("timeout_s", "validity_s"), [(3.0, 60.0), (60.0, 3.0)])
def test_communication_is_lost_by_the_age_of_the_authority(
    timeout_s: float, validity_s: float
) -> None:
    ride = Ride(AuthoritySupervision(LENGTH_M, timeout_s=timeout_s))
    ride.tick(0.0)
    authority = replace(FAR, validity_s=validity_s)
    assert not ride.tick(15.0, authority=authority, age_s=0.25).service_brake
    for _ in range(5):
        assert not ride.tick(15.0, authority=None).service_brake
    assert ride.tick(15.0, authority=None).reason == "no authority"
    speed = 15.0
    for _ in range(60):
        speed = max(0.0, speed - 0.7 * 0.5)
        out = ride.tick(speed, authority=None)
        assert (out.service_brake, out.emergency_brake) == (True, False)
    assert ride.tick(0.0, authority=authority, age_s=3.5).reason == "no authority"
    assert not ride.tick(0.0).service_brake


@pytest.mark.parametrize("blind", ["authority", "position"])
def test_a_service_brake_that_fails_is_backed_by_the_emergency_brake(blind: str) -> None:
    ride = Ride()
    ride.tick(0.0)
    ride.tick(15.0)
    outs = [
        ride.tick(15.0, NOWHERE) if blind == "position" else ride.tick(15.0, authority=None)
        for _ in range(20)
    ]
    assert outs[-1].emergency_brake
    assert not outs[3].emergency_brake


def test_a_train_that_does_not_know_where_it_is_stops() -> None:
    ride = Ride()
    ride.tick(0.0)
    for nowhere in (NOWHERE, at(math.nan), at(10.0, math.inf), Location(1.0, 1.0, False)):
        assert ride.tick(10.0, nowhere).reason == "position unknown"
    assert not ride.tick(5.0).service_brake


def test_old_and_future_authorities_and_those_out_of_order_are_ignored() -> None:
    ride = Ride()
    short = replace(FAR, end_m=50.0)
    assert ride.tick(0.0, age_s=0.2).permitted_mps == 20.0
    for age_s in (0.8, 0.75, -0.1):
        assert ride.tick(0.0, authority=short, age_s=age_s).permitted_mps == 20.0
        ride.time_s -= 0.5
    assert ride.tick(0.0, authority=replace(short, steps=((9.0, 1.0), (8.0, 1.0)))) is not None
    assert ride.supervision.authority is not None
    assert ride.supervision.authority.end_m == 5000.0
    assert ride.tick(0.0, authority=short, age_s=0.1).permitted_mps < 10.0


def test_a_shorter_authority_is_obeyed_at_once() -> None:
    ride = Ride()
    ride.tick(0.0)
    assert not ride.tick(20.0, at(100.0)).service_brake
    out = ride.tick(20.0, at(110.0), replace(FAR, end_m=250.0))
    assert out.emergency_brake


@pytest.mark.parametrize("bad", [(math.nan, 0.0), (1.0, math.nan), (math.inf, 1.0)])
def test_without_an_odometer_the_emergency_brake_is_applied(bad: tuple[float, float]) -> None:
    supervision = AuthoritySupervision(LENGTH_M)
    supervision.update(0.5, at(0.0), 0.0, authority=FAR)
    out = supervision.update(bad[0], at(0.0), bad[1])
    assert (out.emergency_brake, out.reason) == (True, "no odometer")
    assert supervision.update(1.0, at(0.0), 5.0).emergency_brake
    assert not supervision.update(1.5, at(0.0), 0.0).service_brake


def test_a_step_back_in_time_forgets_everything() -> None:
    ride = Ride()
    ride.tick(0.0)
    assert ride.tick(0.0, authority=None, after_s=-0.2).reason == "no authority"


@pytest.mark.parametrize(
    "make",
    [
        lambda: AuthoritySupervision(0.0),
        lambda: AuthoritySupervision(LENGTH_M, direction=2),
        lambda: AuthoritySupervision(LENGTH_M, margin_m=-1.0),
        lambda: AuthoritySupervision(LENGTH_M, timeout_s=0.0),
        lambda: GuaranteedBraking(service_mps2=0.0),
        lambda: GuaranteedBraking(emergency_mps2=0.5),
        lambda: GuaranteedBraking(gradients=GradientProfile([(0.0, 0.0), (9.0, -70.0)])),
        lambda: GuaranteedBraking(service_mps2=((20.0, 0.7), (10.0, 0.6))),
        lambda: GuaranteedBraking(emergency_mps2=((20.0, 0.9), (math.inf, 0.6))),
        lambda: GuaranteedBraking(cut_off_s=2.0),
        lambda: GuaranteedBraking(delay_s=math.nan),
        lambda: GuaranteedBraking(speed_error=1.0),
        lambda: ReceivedAuthority(0.0, 0.0, 1.0, overlap_m=-1.0),
        lambda: ReceivedAuthority(math.nan, 0.0, 1.0),
        lambda: ReceivedAuthority(0.0, 0.0, -1.0),
        lambda: ReceivedAuthority(0.0, 0.0, 1.0, ((math.inf, 1.0),)),
        lambda: ReceivedAuthority(0.0, 0.0, 1.0, validity_s=math.nan),
    ],
)
def test_bad_parameters_are_refused(make: object) -> None:
    with pytest.raises(ValueError, match=r"^\w+: .*(is|are|leaves) "):
        make()  # type: ignore[operator]


def test_a_train_that_is_believed_to_stand_starts_again_though_it_may_be_faster() -> None:
    """A localizer whose interval must hold without the wheels leaves m/s open at a stand."""
    supervision = AuthoritySupervision(LENGTH_M, margin_m=MARGIN_M)

    def tick(time_s: float, speed_mps: float, fastest_mps: float) -> SupervisionOutput:
        authority = replace(FAR, sealed_s=time_s)
        return supervision.update(
            time_s, at(0.0, 5.0), speed_mps, authority=authority, fastest_mps=fastest_mps
        )

    assert flags(tick(0.5, 10.0, 11.0)) == (False, False, False)
    # A doubt that comes all at once takes the service brake, a speed that is believed the other.
    over_mps = 20.0 + LIMITS.emergency_over_mps + 0.5
    assert flags(tick(1.0, 19.0, over_mps)) == (True, True, False)
    assert flags(tick(1.5, over_mps, over_mps)) == (True, True, True)
    assert flags(tick(2.0, 3.0, 6.0)) == (True, True, True)
    assert flags(tick(2.5, 0.0, 3.9)) == (False, False, False)
