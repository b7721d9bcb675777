"""A corridor of the equipment's own pure classes, with a wire for the air, and faults at times.

Three trains run one after the other on a straight track. Zone controller, tracker, protection and
safe channels are the real ones; a zone with one transponder gives a range with 0.1 m of noise, one
with more a signal that cannot be read. What is sent in a tick arrives in the next.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import inf, nan

import numpy as np

from rail_onboard.track_code.supervision import SupervisionOutput
from rail_onboard.train_radio.atp_node import AtpParameters, protection_of
from rail_onboard.train_radio.train_protection import TrainProtection
from rail_wayside.ranging.train_tracker import NO_READING, Reported, ZoneReading, ZoneTracker
from rail_wayside.ranging.zone_map import MappedZone, ZoneMap
from rail_wayside.train_radio.parameters import AuthorityParameters, authority_issuer_of
from rail_world.trains.description import WheelSlip
from rail_world.trains.wheels import Wheels

LENGTH_M, TRACK_M, ZONE_M, LIMIT_MPS = 100.0, 8000.0, 400.0, 20.0
TRACTION_MPS2, SERVICE_MPS2, EMERGENCY_MPS2 = 1.0, 0.9, 1.2
_HELD = SupervisionOutput(0.0, True, True, True, "switched off")


@dataclass(frozen=True)
class PureFault:
    """Something of a kind that fails from one time to another.

    ``atp``, ``radio``, ``vrs``, ``slip``, ``stop`` and ``slack`` of a train, ``wrs`` of a zone,
    ``zone_controller``, ``bases`` and ``ranging`` of all.
    """

    kind: str
    from_s: float
    to_s: float
    which: int = 0
    ratio: float = 1.0

    def acts(self, kind: str, time_s: float, which: int = 0) -> bool:
        return self.kind == kind and self.which == which and self.from_s <= time_s < self.to_s


@dataclass
class PureTrain:
    """The truth of a train, its wheels and its protection."""

    parameters: AtpParameters
    s_m: float
    wheels: Wheels
    speed_mps: float = 0.0
    run_m: float = 0.0
    protection: TrainProtection | None = None
    command: SupervisionOutput = _HELD
    frames: list[bytes] = field(default_factory=list)

    def move(self, tick_s: float, stopped: bool, free_m: float) -> None:
        """Move it by a tick as its driver and its supervision want; in ten steps."""
        out, dt = self.command, 0.1 * tick_s
        for _ in range(10):
            v = self.speed_mps
            wanted = min(v + TRACTION_MPS2 * dt, LIMIT_MPS)
            if out.on_sight:
                sight_m = min(60.0, free_m - 5.0)
                wanted = min(wanted, (2.0 * 0.5 * SERVICE_MPS2 * max(sight_m, 0.0)) ** 0.5)
            wanted = max(min(wanted, out.permitted_mps), v - SERVICE_MPS2 * dt)
            if out.service_brake or stopped:
                wanted = v - SERVICE_MPS2 * dt
            if out.emergency_brake:
                wanted = v - EMERGENCY_MPS2 * dt
            wanted = max(wanted, 0.0)
            moved_m = 0.5 * (v + wanted) * dt
            self.speed_mps, self.s_m, self.run_m = wanted, self.s_m + moved_m, self.run_m + moved_m
            free_m -= moved_m


@dataclass
class PureVerdict:
    """What a run came to."""

    collisions: int = 0
    passed_ends: int = 0
    mislocated: int = 0
    least_gap_m: float = inf
    #: Trains that moved less than 20 m in the last 40 s.
    stuck: list[str] = field(default_factory=list)


class PureCorridor:
    """Trains in a row, the first ahead; see the module."""

    def __init__(
        self,
        starts_m: Sequence[float] = (1300.0, 800.0, 300.0),
        *,
        tick_s: float = 0.5,
        seed: int = 1,
        faults: Iterable[PureFault] = (),
        releases: Iterable[tuple[int, float]] = (),
    ) -> None:
        self.tick_s, self.seed, self.ticks = tick_s, seed, 0
        self.faults, self.releases = tuple(faults), tuple(releases)
        self._rng = np.random.default_rng([seed, 7])
        count = round(TRACK_M / ZONE_M)
        chainages = np.array([0.0, ZONE_M + 200.0])
        self._zones = [
            MappedZone(
                f"z{n:02}", f"w{n:02}", "main", n * ZONE_M, (n + 1) * ZONE_M,
                n * ZONE_M + chainages, chainages,
            )
            for n in range(count)
        ]  # fmt: skip
        follows = {f"z{n:02}": (f"z{n + 1:02}",) for n in range(count - 1)}
        self._map = ZoneMap(self._zones, follows)
        self.names = [f"t{n}" for n in range(1, len(starts_m) + 1)]
        self._entry = [
            (n, f"z{int(s // ZONE_M):02}") for n, s in zip(self.names, starts_m, strict=True)
        ]
        numbers = tuple(range(1, len(starts_m) + 1))
        self._wayside = AuthorityParameters(
            trains=tuple(self.names), bases=("b1",), segments=("main",),
            segment_lengths_m=(TRACK_M,), limit_counts=(1,), limit_from_m=(0.0,),
            limits_mps=(LIMIT_MPS,), train_numbers=numbers,
            train_lengths_m=(LENGTH_M,) * len(numbers), train_segments=(0,) * len(numbers),
            train_starts_m=tuple(starts_m), leaves_at_m=(0.0,) * len(numbers),
            released_trains=tuple(n for n, _ in self.releases),
            released_at_s=tuple(at for _, at in self.releases),
            released_mps=(15.0 / 3.6,) * len(self.releases), seed=seed, tick_s=tick_s,
            secrets=("00" * 16,) * len(numbers),
        )  # fmt: skip
        self._start_controller()
        self.trains = []
        for number, start_m in zip(numbers, starts_m, strict=True):
            parameters = AtpParameters(
                number=number, start_m=start_m, length_m=LENGTH_M, traction_mps2=TRACTION_MPS2,
                most_braking_mps2=EMERGENCY_MPS2 + 0.1, fastest_mps=25.0,
                releases_s=tuple(at for n, at in self.releases if n == number),
                seed=seed, tick_s=tick_s,
            )  # fmt: skip
            slips = [
                WheelSlip(train="t", from_s=f.from_s, to_s=f.to_s, ratio=f.ratio)
                for f in self.faults
                if f.kind == "slip" and f.which == number
            ]
            wheels = Wheels(0.004 * float(self._rng.standard_normal()), slips)
            train = PureTrain(parameters, start_m, wheels)
            train.protection = protection_of(parameters)
            self.trains.append(train)
        self._up: list[tuple[int, bytes]] = []
        self._down: list[tuple[int, bytes]] = []
        self._was_off: set[str] = set()
        self.verdict = PureVerdict()

    @property
    def time_s(self) -> float:
        """Time of the tick to come."""
        return self.ticks * self.tick_s

    def fails(self, kind: str, which: int = 0) -> bool:
        """Whether something fails in this tick."""
        return any(fault.acts(kind, self.time_s + 1e-9, which) for fault in self.faults)

    def step(self) -> None:
        """Run a tick."""
        now_ns = round(self.time_s * 1e9)
        up: list[tuple[int, bytes]] = []
        for number, train in enumerate(self.trains, start=1):
            self._protect(number, train, now_ns, up)
        self._up, arrived = up, self._up
        self._control(now_ns, arrived)
        self._judge()
        for number, train in enumerate(self.trains, start=1):
            ahead = self.trains[number - 2].s_m - LENGTH_M if number > 1 else TRACK_M
            train.move(self.tick_s, self.fails("stop", number), ahead - train.s_m)
        self.ticks += 1

    def _protect(
        self, number: int, train: PureTrain, now_ns: int, up: list[tuple[int, bytes]]
    ) -> None:
        odometer = train.wheels.count(self.time_s, train.run_m, train.speed_mps)
        heard = not (self.fails("radio", number) or self.fails("bases"))
        frames = [frame for slot, frame in self._down if slot == number and heard]
        if self.fails("atp", number):
            train.protection, train.command = None, _HELD
            return
        if train.protection is None:
            train.protection = protection_of(train.parameters)
        train.command = train.protection.tick(now_ns, *odometer, frames)
        if heard:
            up.append((number, train.protection.frame(now_ns)))

    def _start_controller(self) -> None:
        self.issuer = authority_issuer_of(self._wayside)
        self.tracker = ZoneTracker(self._map, self._entry)
        self._controller_on = True

    def _control(self, now_ns: int, arrived: list[tuple[int, bytes]]) -> None:
        self._down = []
        if self.fails("zone_controller"):
            self._controller_on = False
            return
        if not self._controller_on:
            self._start_controller()
        issuer, time_s = self.issuer, self.time_s
        assert issuer is not None
        readings = self._readings()
        reported = {
            self.names[number - 1]: Reported("main", low_m, high_m)
            for number, (_, low_m, high_m) in issuer.whereabouts(time_s).items()
        }
        fixes = self.tracker.update(time_s, readings, reported)
        doubtful = {*self.tracker.unidentified, *self.tracker.disturbed}
        clear = len(readings) == len(self._zones) and not doubtful
        if self.tracker.restarted:
            issuer.sweep(time_s, {0: clear})
        for number, frame in arrived:
            issuer.receive("b1", number, frame, now_ns)
        for number, fix in enumerate(fixes, start=1):
            issuer.ranged(number, time_s, 0, fix.chainage_m, fix.variance_m2)
        for frames in issuer.telegrams(now_ns).values():
            self._down += frames

    def _readings(self) -> dict[str, ZoneReading]:
        readings: dict[str, ZoneReading] = {}
        for index, zone in enumerate(self._zones):
            if self.fails("wrs", index):
                continue
            there = [
                train
                for number, train in enumerate(self.trains, start=1)
                if zone.start_m <= train.s_m < zone.end_m
                and not (self.fails("vrs", number) or self.fails("ranging"))
            ]
            if not there:
                readings[zone.name] = NO_READING
            elif len(there) > 1:
                readings[zone.name] = ZoneReading(nan, inf)
            else:
                noise_m = 0.1 * float(self._rng.standard_normal())
                readings[zone.name] = ZoneReading(there[0].s_m - zone.start_m + noise_m, 0.1**2)
        return readings

    def _judge(self) -> None:
        verdict, now_ns = self.verdict, round(self.time_s * 1e9)
        for ahead, train in zip(self.trains, self.trains[1:], strict=False):
            gap_m = ahead.s_m - LENGTH_M - train.s_m
            verdict.least_gap_m = min(verdict.least_gap_m, gap_m)
            verdict.collisions += gap_m < 0.0
        for train in self.trains:
            if train.protection is None:
                continue
            state = train.protection.state_values(now_ns)
            verdict.mislocated += abs(state[3] - train.s_m) > state[4] + 1e-6
            verdict.passed_ends += (
                train.s_m > state[5] and train.speed_mps > 0.05 and not train.command.on_sight
            )

    def run_until(self, time_s: float) -> None:
        """Run ticks up to a time."""
        while self.time_s < time_s:
            self.step()

    def run(self, live_s: float = 90.0, over_s: float = 40.0) -> PureVerdict:
        """Run until ``live_s`` after the last fault, then look whether all trains move."""
        self.run_until(max((fault.to_s for fault in self.faults), default=0.0) + live_s)
        before_m = [train.s_m for train in self.trains]
        self.run_until(self.time_s + over_s)
        self.verdict.stuck = [
            name
            for name, train, was_m in zip(self.names, self.trains, before_m, strict=True)
            if train.s_m < min(was_m + 20.0, TRACK_M - 250.0)
        ]
        return self.verdict


KINDS = ("atp", "radio", "vrs", "wrs", "zone_controller", "bases", "ranging", "slip")


def draw_faults(seed: int, count: int) -> list[PureFault]:
    """Faults at random, and in every other run a leader that stands for as long."""
    rng = np.random.default_rng([seed, 11])
    faults = []
    for _ in range(count):
        kind = str(rng.choice(KINDS))
        from_s = round(float(rng.uniform(5.0, 70.0)), 1)
        longest_s = 40.0 if rng.random() < 0.5 else 6.0
        to_s = round(from_s + float(rng.uniform(0.6, longest_s)), 1)
        which = int(rng.integers(1, 4))
        if kind == "wrs":
            which = int(rng.integers(0, 6))
        elif kind in ("zone_controller", "bases", "ranging"):
            which = 0
        ratio = float(rng.choice([0.0, 0.3, 0.6, 0.8, 1.5, 3.0]))
        faults.append(PureFault(kind, from_s, to_s, which, ratio))
    if rng.random() < 0.5:
        which = int(rng.integers(1, 3))
        faults.append(PureFault("stop", 20.0, max(f.to_s for f in faults) + 5.0, which))
    return faults
