"""Heedless and heedful drivers on random lines: what supervision alone keeps, with either brake."""

from __future__ import annotations

import itertools
from collections import deque
from dataclasses import dataclass, replace
from math import inf

import numpy as np
import pytest

from rail_onboard.braking_curve import GuaranteedBraking, Rates, least_rate
from rail_onboard.gradient_profile import GradientProfile
from rail_onboard.track_code.supervision import STANDSTILL_MPS, SupervisionOutput, Thresholds
from rail_onboard.train_radio.authority_curves import AuthorityCurves
from rail_onboard.train_radio.supervision import (
    AuthoritySupervision,
    CurveTimes,
    ReceivedAuthority,
)
from rail_onboard.train_radio.train_location import Location

GRAVITY_MPS2 = 9.80665
LIMITS = Thresholds()
MARGIN_M = 6.0
#: Rounding of the steps of the integration.
STEP_S = 0.05
SLACK_M = 0.1


@dataclass
class Line:
    """A drawn line, train and authority."""

    gradients: list[tuple[float, float]]
    length_m: float
    tick_s: float
    braking: GuaranteedBraking
    authority: ReceivedAuthority
    half_m: float
    off: float
    speed_error: float
    start_m: float

    def permil(self, front_m: float) -> float:
        """Mean gradient under the train."""
        rear_m = front_m - self.length_m
        return (self._height(front_m) - self._height(rear_m)) / self.length_m

    def _height(self, at_m: float) -> float:
        """Integral of the gradient from 0 [permil m]."""
        height = 0.0
        for (from_m, permil), to_m in zip(
            self.gradients, [*(x for x, _ in self.gradients[1:]), inf], strict=True
        ):
            if from_m > 0.0 and at_m <= from_m:
                break
            height += permil * (min(at_m, to_m) - from_m)
        return height


def drawn(seed: int, *, release: bool = False, bands: bool = False) -> Line:
    draw = np.random.default_rng(seed)
    places = np.unique(np.round(draw.uniform(50.0, 2950.0, draw.integers(0, 12)), 1))
    gradients = [(0.0, float(draw.uniform(-40.0, 40.0)))]
    gradients += [(float(at), float(draw.uniform(-40.0, 40.0))) for at in places]
    tick_s = float(draw.choice([0.1, 0.2, 0.25, 0.5, 1.0]))
    error = float(draw.uniform(0.0, 0.03))
    service: Rates = ((inf, float(draw.uniform(0.6, 0.9))),)
    emergency: Rates = ((inf, service[0][1] * float(draw.uniform(1.0, 1.4))),)
    if bands:
        service = ((12.0, service[0][1]), (inf, 0.8 * service[0][1]))
        emergency = ((18.0, emergency[0][1]), (inf, 0.9 * emergency[0][1]))
    braking = GuaranteedBraking(
        service,
        emergency,
        GradientProfile(gradients),
        delay_s=2.0 * max(0.5, tick_s) + 0.1,
        cut_off_s=2.0 * max(0.5, tick_s),
        build_up_s=float(draw.uniform(0.0, 2.0)),
        traction_mps2=float(draw.uniform(0.5, 1.1)),
        speed_error=error,
    )
    steps = tuple(
        (at, float(draw.uniform(5.0, 22.0))) for at in sorted(draw.uniform(900.0, 2000.0, 2))
    )
    authority = ReceivedAuthority(
        0.0,
        float(draw.uniform(2000.0, 2800.0)),
        float(draw.uniform(8.0, 24.0)),
        steps,
        overlap_m=80.0 if release else float(draw.choice([0.0, 10.0, 40.0])),
        release=release,
    )
    return Line(
        gradients,
        float(draw.uniform(20.0, 400.0)),
        tick_s,
        braking,
        authority,
        float(draw.uniform(0.0, 6.0)),
        float(draw.uniform(-1.0, 1.0)),
        error * float(draw.uniform(-1.0, 1.0)),
        float(draw.uniform(500.0, 900.0)),
    )


@dataclass
class Run:
    """A train on a line; a demand of the brake acts in the tick after the next measurement."""

    line: Line
    obeys: str  # the brake that works
    heedful: bool = False
    sure: float = 1.0  # brake rates over the guaranteed ones

    def __post_init__(self) -> None:
        line = self.line
        cycle_s = max(0.5, line.tick_s)
        self.supervision = AuthoritySupervision(
            line.length_m,
            margin_m=MARGIN_M,
            braking=line.braking,
            times=CurveTimes(driver_s=2.0 * cycle_s),
            fastest_mps=30.0,
        )
        self.s, self.v, self.time_s, self.force = line.start_m, 0.0, 0.0, 0.0
        self.acted_s = 0.0
        # Measurements reach the brake a tick late.
        idle = SupervisionOutput(0.0, False, False, False, "")
        self.outs = deque([idle])

    def tick(self) -> SupervisionOutput:
        line = self.line
        here = Location(self.s + line.off * line.half_m, line.half_m, True)
        authority = replace(line.authority, sealed_s=self.time_s)
        measured = self.v / (1.0 + line.speed_error)
        out = self.supervision.update(self.time_s, here, measured, authority=authority)
        self.outs.append(out)
        self.move(self.outs.popleft())
        return out

    def move(self, out: SupervisionOutput) -> None:
        line, braking = self.line, self.line.braking
        emergency = out.emergency_brake and self.obeys != "service"
        service = out.service_brake and self.obeys != "emergency"
        demanded = emergency or service
        permitted = out.permitted_mps if self.heedful else inf
        for _ in range(round(line.tick_s / STEP_S)):
            self.acted_s = self.acted_s + STEP_S if demanded else 0.0
            ramp_s = max(0.0, self.acted_s - 0.1)  # dead time
            share = 1.0 if braking.build_up_s == 0.0 else min(1.0, ramp_s / braking.build_up_s)
            share *= ramp_s > 0.0
            rates = braking.emergency if emergency else braking.service
            rate = self.sure * share * least_rate(rates, self.v, self.v)
            slope = GRAVITY_MPS2 * 1e-3 * line.permil(self.s)
            slope = slope if slope < 0.0 else slope / 1.15
            a = -slope - rate if demanded else 0.0
            if not demanded:
                pull = 0.0 if out.traction_cut_off else braking.traction_mps2
                a = pull - slope
                if self.heedful:
                    full = -slope - 1.3 * least_rate(braking.service, self.v, self.v)
                    wanted = (permitted - self.v) / STEP_S
                    stop_m = line.authority.end_m - 0.5 - self.s
                    if line.authority.release and stop_m <= 0.05:
                        wanted = min(wanted, -self.v / STEP_S)
                    elif line.authority.release and self.v**2 > 0.5 * stop_m:
                        wanted = min(wanted, -0.6)
                    a = max(full, min(a, wanted))
            faster = self.v + a * STEP_S
            if faster <= 0.0:
                self.s += 0.5 * self.v * STEP_S * (self.v / max(self.v - faster, 1e-12))
                self.v = 0.0
            else:
                self.s += 0.5 * (self.v + faster) * STEP_S
                self.v = faster
            self.time_s += STEP_S
        self.time_s = round(self.time_s / line.tick_s) * line.tick_s

    def limit_mps(self) -> float:
        """Least limit under the train."""
        authority, rear_m = self.line.authority, self.s - self.line.length_m
        held = [(-inf, authority.limit_mps), *authority.steps, (inf, inf)]
        return min(
            limit
            for (from_m, limit), (to_m, _) in itertools.pairwise(held)
            if from_m <= self.s and to_m > rear_m
        )


@pytest.mark.parametrize("bands", [False, True])
@pytest.mark.parametrize("obeys", ["service", "emergency"])
def test_either_brake_alone_keeps_a_heedless_driver_before_end_and_danger_point(
    obeys: str, bands: bool
) -> None:
    intervened = came = 0
    for seed in range(30):
        line = drawn(seed, bands=bands)
        run = Run(line, obeys)
        end_m, danger_m = line.authority.end_m, line.authority.end_m + line.authority.overlap_m
        # With less than the way of a train at m in the margin it may come into the overlap.
        rolling_m = line.braking.stopping_m(LIMITS.service_over_mps)
        sure_m = min(danger_m, end_m + max(0.0, rolling_m - MARGIN_M))
        gathered = line.braking.gathering_mps2 * (line.braking.full_force_s + line.tick_s)
        over = LIMITS.service_over_mps if obeys == "service" else LIMITS.emergency_over_mps
        stood_s = 0.0
        while run.time_s < 900.0 and stood_s < 20.0:
            out = run.tick()
            stood_s = stood_s + line.tick_s if run.v == 0.0 else 0.0
            assert run.s <= (sure_m if obeys == "service" else danger_m) + SLACK_M
            most = (run.limit_mps() + over) * (1.0 + line.braking.speed_error) + gathered
            assert run.v <= most + 1e-6
            intervened += out.service_brake and run.v > STANDSTILL_MPS
        came += run.s > end_m - 60.0
    assert intervened > 100 and came > 20


def test_either_brake_alone_keeps_a_heedless_driver_before_the_buffer_on_a_release_speed() -> None:
    past = 0
    for obeys in ("service", "emergency"):
        for seed in range(200, 225):
            line = drawn(seed, release=True)
            run = Run(line, obeys)
            danger_m, stood_s = line.authority.end_m + line.authority.overlap_m, 0.0
            while run.time_s < 900.0 and stood_s < 20.0:
                run.tick()
                stood_s = stood_s + line.tick_s if run.v == 0.0 else 0.0
                assert run.s <= danger_m + SLACK_M
            past += run.s > line.authority.end_m
    assert past > 10  # the overlap is used: nothing else stops him


@pytest.mark.parametrize("release", [False, True])
def test_a_heedful_driver_is_never_braked(release: bool) -> None:
    arrived = 0
    for seed in range(400, 430):
        line = drawn(seed, release=release)
        run = Run(line, "both", heedful=True)
        stood_s = 0.0
        while run.time_s < 1500.0 and stood_s < 20.0:
            out = run.tick()
            stood_s = stood_s + line.tick_s if run.v <= STANDSTILL_MPS else 0.0
            assert not out.emergency_brake
            if run.time_s > 2.0 and run.s < line.authority.end_m - 30.0:
                assert not out.service_brake, (seed, out, run.v)
        arrived += abs(run.s - line.authority.end_m) < 1.0
    if release:
        assert arrived > 25


def test_a_release_speed_stops_before_the_danger_point_from_the_trip_at_the_end() -> None:
    braking = GuaranteedBraking(traction_mps2=0.0)
    curves = AuthorityCurves(100.0, braking=braking, margin_m=6.0)
    here = Location(990.0, 2.0, True)
    for overlap_m, expected in ((20.0, True), (5.0, False)):
        authority = ReceivedAuthority(0.0, 1000.0, 20.0, overlap_m=overlap_m, release=True)
        found = curves.at(authority, here).release_mps
        assert (found > 0.0) is expected
        if expected:
            # By either brake, from 4 m past the end: the service brake needs more.
            v = found + LIMITS.service_over_mps
            assert v * 1.0 + v**2 / 1.4 == pytest.approx(overlap_m - 4.0)
    beyond = curves.at(authority, Location(1003.0, 2.0, True))
    assert beyond.passed and beyond.permitted_mps == 0.0


def test_the_curves_lie_in_their_order() -> None:
    for seed in range(600, 640):
        line = drawn(seed, release=bool(seed % 2))
        curves = AuthorityCurves(line.length_m, braking=line.braking, margin_m=MARGIN_M)
        for s in np.linspace(line.start_m, line.authority.end_m - 20.0, 40):
            here = Location(float(s), line.half_m, True)
            found = curves.at(line.authority, here)
            assert found.permitted_mps <= found.warning_mps <= found.service_mps
            assert found.permitted_mps <= found.emergency_mps + 1e-9
            guidance_mps, indication_mps = curves.advice(line.authority, here)
            assert indication_mps <= found.permitted_mps + 1e-9 or found.release_mps
            assert guidance_mps >= 0.0


def test_limits_that_come_down_are_answered_by_the_service_brake() -> None:
    supervision = AuthoritySupervision(100.0, margin_m=6.0)
    free = ReceivedAuthority(0.0, 5000.0, 20.0)
    s, v, out = 1000.0, 19.0, None
    for tick in range(80):
        time_s = 0.5 * tick
        told = free if tick < 4 else replace(free, limit_mps=8.0)
        told = replace(told, sealed_s=time_s)
        out = supervision.update(time_s, Location(s, 1.0, True), v, authority=told)
        assert not out.emergency_brake
        assert out.service_brake or tick < 4 or v <= 8.7
        s, v = s + 0.5 * v, max(7.0, v - 0.35) if out.service_brake else v
    assert v < 8.0
    # If the service brake does not answer the emergency brake does.
    supervision.reset()
    for tick in range(30):
        time_s = 100.0 + 0.5 * tick
        told = replace(free, sealed_s=time_s, limit_mps=20.0 if tick < 4 else 8.0)
        out = supervision.update(time_s, Location(1000.0, 1.0, True), 19.0, authority=told)
    assert out is not None and out.emergency_brake
