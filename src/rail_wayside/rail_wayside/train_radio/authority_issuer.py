"""Where a zone controller speaks with trains: reports in, movement authorities out.

What a train says counts if the safe channel accepts it; it is then the moving block's. Frames to
a train go through the base station that brought its last report, or through all of them as long
as none has.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite, nan, sqrt
from typing import NamedTuple

from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.train_channel import CountedChannel, FrameEnd
from rail_msgs_py.train_radio.train_report import LocationReport

from .moving_block import IssuedAuthority, MovingBlock, to_telegram
from .train_bounds import Trouble

#: By so much another train's signal, 30 dB below, moves a range without being noticed [m].
_UNSEEN_M = 1.5
#: No train brakes harder [m/s^2].
_MOST_BRAKING_MPS2 = 1.5
#: Who was past stopping before the border and has been silent for so long has left [s].
_LEFT_S = 3.0
_DOUBTFUL = frozenset({Trouble.RANGE, Trouble.RANGE_SEGMENT, Trouble.LEAP})


@dataclass
class _ConnectedTrain:
    """What the desk remembers of one train."""

    channel: CountedChannel
    leaves_at_m: float
    base: str | None = None
    place: tuple[float, float, float] | None = None  # time, ranged then, half-width
    held: IssuedAuthority | None = None
    #: Whether it can no longer stop before the place at which it leaves.
    leaving: bool = False


class AuthorityState(NamedTuple):
    """What a train was given, as ``AUTHORITY.columns``; NaN = nothing."""

    end_of_authority_m: float
    limit_mps: float
    worst_rear_m: float
    report_age_s: float
    accepted: int
    lost: int
    rejected: int


class AcceptedReport(NamedTuple):
    """A report taken from a train, true at `sealed_s`, the time-stamp of its frame."""

    sealed_s: float
    report: LocationReport


class AuthorityIssuer:
    """Exchanges frames with the trains of a control area.

    Parameters
    ----------
    block : MovingBlock
    channels : mapping
        Safe channel of each train by its number; the number is that of its radio slot too.
    bases : iterable of str
        Base stations.
    leaves_at_m : mapping, optional
        Chainage at which a train passes to the next control area [m]; missing = it does not.
    fix_sigmas : float
        Half-width of the interval told to a train, in standard deviations of its range.
    """

    def __init__(
        self,
        block: MovingBlock,
        channels: Mapping[int, FrameEnd],
        bases: Iterable[str],
        *,
        leaves_at_m: Mapping[int, float] | None = None,
        fix_sigmas: float = 4.0,
    ) -> None:
        leaves = leaves_at_m or {}
        self._block, self._bases, self._sigmas = block, tuple(bases), fix_sigmas
        self._callers = {
            number: _ConnectedTrain(CountedChannel(channel), leaves.get(number, inf))
            for number, channel in channels.items()
        }

    def receive(self, base: str, slot: int, frame: bytes, time_ns: int) -> AcceptedReport | None:
        """Take a frame that a base station received in the slot of a train; its report, if any."""
        caller = self._callers.get(slot)
        if caller is None:
            return None
        genuine, opened = caller.channel.open(frame, time_ns)
        if genuine:
            caller.base = base
        if opened is None:
            return None
        try:
            report = LocationReport.from_bytes(opened.payload)
        except ValueError:
            caller.channel.refuse()
            return None
        sealed_s = time_ns / NANOSECONDS - opened.age_s
        self._block.report(slot, sealed_s, report)
        if report.position_valid:
            if report.front_m >= caller.leaves_at_m:
                self._block.remove(slot)
            stopping_m = 0.5 * report.speed_mps**2 / _MOST_BRAKING_MPS2
            least_m = report.front_m - report.uncertainty_m
            caller.leaving = least_m + stopping_m >= caller.leaves_at_m
        return AcceptedReport(sealed_s, report)

    def ranged(
        self, number: int, time_s: float, segment: int, position_m: float, variance_m2: float
    ) -> None:
        """Take the position of a train by phase ranging; an infinite variance = not known."""
        caller = self._callers[number]
        if not (isfinite(position_m) and isfinite(variance_m2)):
            return
        sigma_m = sqrt(variance_m2) + _UNSEEN_M / self._sigmas
        accepted = self._block.ranged(number, time_s, segment, position_m, sigma_m)
        # A range that contradicts what the train reports is nothing to tell it.
        if accepted and not _DOUBTFUL.intersection(self._block.troubles(number)):
            caller.place = time_s, position_m, self._sigmas * sigma_m

    def telegrams(self, time_ns: int) -> dict[str, list[tuple[int, bytes]]]:
        """Frames for every train, by base station, each with its slot."""
        out: dict[str, list[tuple[int, bytes]]] = {base: [] for base in self._bases}
        for number, caller in self._callers.items():
            if caller.leaving and caller.channel.channel.silence_s(time_ns) > _LEFT_S:
                self._block.remove(number)
            authority = self._block.authority(number, time_ns / NANOSECONDS)
            caller.held = authority
            if authority is None:
                continue
            telegram = to_telegram(authority, _now(caller.place, time_ns / NANOSECONDS))
            frame = caller.channel.channel.seal(
                FrameKind.MOVEMENT_AUTHORITY, telegram.to_bytes(), time_ns
            )
            for base in self._bases if caller.base is None else (caller.base,):
                out[base].append((number, frame))
        return out

    def authority_state(self, number: int, time_ns: int) -> AuthorityState:
        """What a train was given last, and how its reports come in."""
        caller = self._callers[number]
        held = caller.held
        occupied = self._block.occupied(number, time_ns / NANOSECONDS)
        return AuthorityState(
            nan if held is None else held.end_m,
            nan if held is None else held.limit_mps,
            nan if occupied is None else occupied[0],
            caller.channel.channel.silence_s(time_ns),
            *caller.channel.counts,
        )

    def troubles(self, number: int) -> str:
        """What does not fit about a train; empty if all does."""
        return ", ".join(trouble.value for trouble in self._block.troubles(number))


def _now(place: tuple[float, float, float] | None, time_s: float) -> tuple[float, float] | None:
    """Place and half-width, if they are of this very time."""
    return place[1:] if place is not None and abs(place[0] - time_s) < 1e-6 else None
