"""A row of track circuits without signals: what each receiver says follows from where axles are."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from rail_wayside.track_code.detector import PICK_UP_S
from rail_wayside.track_code.sequence import CircuitState, SequenceHold

AHEAD = 8


@dataclass
class Train:
    """A train in a row; its axles shunt unless `fails` says so of the time [s]."""

    front_m: float
    length_m: float
    speed_mps: float = 15.0
    fails: Callable[[float], bool] = lambda time_s: False
    stops_m: float = 1e9

    def run(self, tick_s: float) -> None:
        self.front_m = min(self.stops_m, self.front_m + tick_s * self.speed_mps)


@dataclass
class Row:
    """Circuits of equal length; `dead` are those without a transmitter, `off` switched off."""

    count: int
    length_m: float
    tick_s: float
    trains: list[Train] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.holds = [self._new(index) for index in range(self.count)]
        self.states: list[CircuitState | None] = [None] * self.count
        self.clear_s = [0.0] * self.count
        self.time_s = 0.0
        self.was_off: set[int] = set()

    def _new(self, index: int) -> SequenceHold:
        return SequenceHold(self.tick_s, first=index == 0)

    def inside(self, train: Train, index: int) -> bool:
        rear_m = train.front_m - train.length_m
        return rear_m < (index + 1) * self.length_m and train.front_m > index * self.length_m

    def tick(self, dead: Iterable[int] = (), off: Iterable[int] = ()) -> list[bool]:
        """One tick; returns which circuits are occupied."""
        before = self.states
        states: list[CircuitState | None] = []
        for index in range(self.count):
            if index in off:
                self.was_off.add(index)
                states.append(None)
                continue
            if index in self.was_off:
                self.was_off.discard(index)
                self.holds[index], self.clear_s[index] = self._new(index), 0.0
            shunted = index in dead or any(
                self.inside(train, index) and not train.fails(self.time_s) for train in self.trains
            )
            self.clear_s[index] = 0.0 if shunted else self.clear_s[index] + self.tick_s
            states.append(
                self.holds[index].update(
                    detected=self.clear_s[index] < PICK_UP_S - 1e-9,
                    shunted=shunted,
                    behind=before[index - 1] if index else None,
                    ahead=before[index + 1 : index + 1 + AHEAD],
                )
            )
        self.states = states
        self.time_s += self.tick_s
        for train in self.trains:
            train.run(self.tick_s)
        return [state is None or state.occupied for state in states]

    def unguarded(self, train: Train, occupied: list[bool]) -> bool:
        """Whether the circuit of the tail is clear, and the one before it: nothing keeps away."""
        tail = int((train.front_m - train.length_m) // self.length_m)
        return not any(occupied[max(0, tail - 1) : tail + 1])
