"""What happens to trains, judged by the truth: collisions, derailments, who stands and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import Final, Literal

from rail_world.line.network import Network

from .curve_speed import CurveSpeed
from .drive_command import DriveCommand
from .motion import TrainMotion
from .occupancy import overlaps
from .traffic import Traffic

Kind = Literal["collision", "derailment", "end of track passed", "stall", "stuck", "entrance"]

#: Who wants to go on and cannot pull is said to have stalled after that time [s].
STALL_S: Final = 5.0
#: Causes of a stand are looked for that often [s].
_LOOK_S: Final = 1.0


@dataclass(frozen=True)
class Event:
    """Something that began, or is over.

    Parameters
    ----------
    kind : str
    train : str
        Whom it befalls; of a collision the first of the two.
    track : str
    at_m : float
        Where: chainage [m].
    text : str
        A sentence without the place.
    other : str
        The other one of a collision.
    over : bool
        Whether it is over.
    """

    kind: Kind
    train: str
    track: str
    at_m: float
    text: str
    other: str = ""
    over: bool = False

    @property
    def level(self) -> Literal["ok", "warn", "error"]:
        """How grave it is."""
        if self.over:
            return "ok"
        return "warn" if self.kind == "entrance" else "error"

    @property
    def subject(self) -> str:
        """Aspect of the world that it is."""
        return f"{self.kind}, {self.train}" + (f" and {self.other}" if self.other else "")

    @property
    def message(self) -> str:
        """What happened, and where."""
        return f"{self.text}, at {self.at_m:.1f} m of {self.track}"

    @property
    def values(self) -> tuple[tuple[str, str], ...]:
        """For those who do not read sentences."""
        known = ("kind", self.kind), ("train", self.train), ("track", self.track)
        other = (("other", self.other),) if self.other else ()
        return (*known, ("at_m", f"{self.at_m:.3f}"), *other)


class Judge:
    """Finds what happens, tick by tick.

    Parameters
    ----------
    traffic : Traffic
    network : Network
    quiet_from_s : float
        When the last fault has ended; who stands before that is not stuck [s].
    patience_s : float
        Who stands for longer without a reason is stuck [s].
    queue_m : float
        A train stands behind one that has a reason to stand if it is within that way [m].
    """

    def __init__(
        self,
        traffic: Traffic,
        network: Network,
        *,
        quiet_from_s: float = 0.0,
        patience_s: float = 60.0,
        queue_m: float = 200.0,
    ) -> None:
        self._traffic = traffic
        self._patience_s, self._queue_m = patience_s, queue_m
        #: When the last fault has ended.
        self.quiet_from_s = quiet_from_s
        curves: dict[tuple[str, ...], CurveSpeed] = {}
        for train in traffic.trains:
            if train.route.tracks not in curves:
                curves[train.route.tracks] = CurveSpeed(train.route, network)
        self._curves = [curves[train.route.tracks] for train in traffic.trains]
        #: Since when each has stood without a reason.
        self._since_s = [0.0] * len(traffic.trains)
        self._stalled_s = [inf] * len(traffic.trains)
        self._standing: dict[tuple[Kind, int, int], Event] = {}
        self._looked_s = -inf

    def judge(self, time_s: float, commands: Mapping[str, DriveCommand]) -> list[Event]:
        """What has begun or ended at a time, under what is imposed on trains by name."""
        found = {(e.kind, *who): e for who, e in self._dangers()}
        if looks := time_s - self._looked_s >= _LOOK_S - 1e-9:
            self._looked_s = time_s
            found |= {(e.kind, *who): e for who, e in self._stands(time_s, commands)}
        events = []
        for key, event in found.items():
            if key not in self._standing:
                self._standing[key] = event
                events.append(event)
        for key in [key for key in self._standing if key not in found]:
            if key[0] in ("stall", "stuck", "entrance") and not looks:
                continue
            event = self._standing.pop(key)
            track, at_m = self._place(self._traffic.trains[key[1]])
            ended = replace(event, track=track, at_m=at_m, text="it is over", over=True)
            events.append(ended)
        return events

    def _dangers(self) -> Iterator[tuple[tuple[int, int], Event]]:
        trains = self._traffic.trains
        if len(trains) > 1:
            for first, second, stretch in overlaps(self._traffic.occupants):
                one, other = trains[first], trains[second]
                speeds = f"{3.6 * abs(one.speed_mps):.0f} and {3.6 * abs(other.speed_mps):.0f}"
                text = f"collision of {one.name} and {other.name} at {speeds} km/h"
                at_m = 0.5 * (stretch.low_m + stretch.high_m)
                yield (
                    (first, second),
                    Event("collision", one.name, stretch.track, at_m, text, other.name),
                )
        for index, (train, curves) in enumerate(zip(trains, self._curves, strict=True)):
            v = abs(train.speed_mps)
            if v > curves.least_mps and self._traffic.on_line(index):
                bears_mps = curves.between(train.low_m, train.high_m)
                if v > bears_mps:
                    text = f"{train.name} leaves the rails at {3.6 * v:.0f} km/h in a curve that"
                    text += f" bears {3.6 * bears_mps:.0f}"
                    yield (index, index), self._event("derailment", train, text)
            if train.ran_off_mps > 0.0:
                text = f"{train.name} ran into the end of the track"
                text += f" at {3.6 * train.ran_off_mps:.0f} km/h"
                yield (index, index), self._event("end of track passed", train, text)

    def _stands(
        self, time_s: float, commands: Mapping[str, DriveCommand]
    ) -> Iterator[tuple[tuple[int, int], Event]]:
        for index, train in enumerate(self._traffic.trains):
            waits = train.due or (train.state == "running" and train.speed_mps == 0.0)
            if not waits:
                self._since_s[index], self._stalled_s[index] = time_s, inf
                continue
            command = commands.get(train.name, DriveCommand())
            cause = self._cause(index, command)
            if train.due and (other := self._blocker(index)) is not None:
                text = f"{train.name} waits at the entrance: {other} is in the way"
                yield (index, index), self._event("entrance", train, text)
            pulls = _held(command) or train.pulls or train.due
            self._stalled_s[index] = inf if pulls else min(self._stalled_s[index], time_s)
            if time_s - self._stalled_s[index] >= STALL_S:
                text = f"{train.name} has stalled: its motors cannot pull it up here"
                yield (index, index), self._event("stall", train, text)
            if self._excused(index, {index}):
                self._since_s[index] = time_s
            stood_s = time_s - max(self._since_s[index], self.quiet_from_s)
            if stood_s > self._patience_s:
                text = f"{train.name} is stuck, for {self._patience_s:g} s without a reason: "
                yield (index, index), self._event("stuck", train, text + cause)

    def _excused(self, index: int, asked: set[int]) -> bool:
        """Whether a train that stands has one close ahead that runs, or has a reason to stand."""
        train = self._traffic.trains[index]
        if train.due:
            other = self._traffic.in_the_way(index, self._traffic.occupants)
            if other is None or other in asked:
                return False
        else:
            ahead_m, other = self._traffic.next_ahead(index)
            if ahead_m > self._queue_m or other in asked:
                return False
        ahead = self._traffic.trains[other]
        if ahead.state in ("dwelling", "arrived") or (ahead.state == "waiting" and not ahead.due):
            return True
        if ahead.speed_mps != 0.0:  # it is on its way out of his way, or comes at him
            return ahead.direction == train.direction
        return self._excused(other, asked | {other})

    def _cause(self, index: int, command: DriveCommand) -> str:
        """What a train that stands waits for."""
        train = self._traffic.trains[index]
        if train.due:
            return f"{self._blocker(index) or 'nobody'} is at its entrance"
        if not _held(command):
            return "its motors cannot pull it" if not train.pulls else "its driver does not start"
        held = "the emergency brake" if command.emergency_brake else "the service brake"
        if not (command.emergency_brake or command.service_brake):
            held = "no traction" if command.traction_cut_off else "no speed permitted"
        ahead_m, other = self._traffic.next_ahead(index)
        if ahead_m == inf:
            return f"{held}; no train is ahead"
        return f"{held}; {self._traffic.names[other]} is {ahead_m:.0f} m ahead"

    def _blocker(self, index: int) -> str | None:
        other = self._traffic.in_the_way(index, self._traffic.occupants)
        return None if other is None else self._traffic.names[other]

    def _event(self, kind: Kind, train: TrainMotion, text: str) -> Event:
        return Event(kind, train.name, *self._place(train), text)

    def _place(self, train: TrainMotion) -> tuple[str, float]:
        return train.track, train.chainage_m


def _held(command: DriveCommand) -> bool:
    """Whether a train is not let go."""
    brakes = command.emergency_brake or command.service_brake
    return brakes or command.traction_cut_off or command.max_speed_mps <= 0.0
