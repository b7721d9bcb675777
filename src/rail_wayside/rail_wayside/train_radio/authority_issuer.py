"""Where a zone controller speaks with trains: reports in, movement authorities out.

What a train says counts if the safe channel accepts it; it is then the moving block's. Frames to
a train go through the base station that brought its last report, or through all of them as long
as none has.

A train is told where it was ranged, whether that agrees with what it reports or not: it compares
that with its odometer. One that reports that it does not know where it is, is told where it must
be by its reports of before, narrowed by a range that agrees with them; so it is located anew even
where it cannot be ranged. A train that gets no authority is told so by one that is void.

What was entered of where trains are counts only for a controller that is on from the start of the
run, time 0. One that is switched on later knows nothing (see ``Opening``).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf, isfinite, nan, sqrt
from typing import NamedTuple

from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.train_radio.cycle import Cycle
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.train_channel import CountedChannel, FrameEnd
from rail_msgs_py.train_radio.train_report import FURTHEST_M, WIDEST_M, LocationReport

from .moving_block import IssuedAuthority, MovingBlock, to_telegram
from .train_bounds import Trouble

#: By so much another train's signal, 30 dB below, moves a range without being noticed [m].
_UNSEEN_M = 1.5
#: No train brakes harder [m/s^2].
_MOST_BRAKING_MPS2 = 1.5
#: Who was past stopping before the border and has been silent for so long has left [s].
_LEFT_S = 3.0
#: Faster than the speed on sight by this, a train brakes [m/s].
_OVER_ON_SIGHT_MPS = 2.0


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


class Release(NamedTuple):
    """A person lets a train run on sight from a time on, no faster than a speed."""

    number: int
    at_s: float
    speed_mps: float


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
    releases : iterable of Release
        Of trains to run on sight; one before the controller is on goes unheard.
    tick_s, period_s : float
        Time of a tick, and from authority to authority of a train: at least a tick.
    """

    def __init__(
        self,
        block: MovingBlock,
        channels: Mapping[int, FrameEnd],
        bases: Iterable[str],
        *,
        leaves_at_m: Mapping[int, float] | None = None,
        fix_sigmas: float = 4.0,
        releases: Iterable[Release] = (),
        tick_s: float = 1.0,
        period_s: float = 0.0,
    ) -> None:
        leaves = leaves_at_m or {}
        self._block, self._bases, self._sigmas = block, tuple(bases), fix_sigmas
        self._cycle = Cycle(period_s, tick_s)
        self._callers = {
            number: _ConnectedTrain(CountedChannel(channel), leaves.get(number, inf))
            for number, channel in channels.items()
        }
        self._releases = sorted(releases, key=lambda release: release.at_s)
        self._begun = False

    def _begin(self, time_s: float) -> None:
        """Start, in the first tick; later than time 0 it is a restart."""
        if self._begun:
            return
        self._begun = True
        if time_s > 0.0:
            self._block.restart(time_s)
            self._releases = [each for each in self._releases if each.at_s > time_s - 1e-9]

    @property
    def gone(self) -> frozenset[int]:
        """Numbers of trains that have left."""
        return frozenset(self._callers) - frozenset(self._block.trains)

    def whereabouts(self, time_s: float) -> dict[int, tuple[int, float, float]]:
        """Segment of every train whose place is known, least and greatest chainage of its front.

        For a tracker that was started anew and knows no train. One that alone is not accounted for
        is anywhere.
        """
        self._begin(time_s)
        found: dict[int, tuple[int, float, float]] = {}
        for number in self._block.trains:
            place = self._block.place_of(number)
            between = self._block.front_between(number, time_s)
            if place is None:
                continue
            if between is not None:
                found[number] = (place[0], *between)
            elif self._block.everywhere(number, time_s):
                found[number] = place[0], -inf, inf
        return found

    def sweep(self, time_s: float, clear: Mapping[int, bool]) -> None:
        """Take whether all readings of each segment are those of known trains, and all came."""
        self._begin(time_s)
        for segment, is_clear in clear.items():
            self._block.sweep(time_s, segment, is_clear)

    def waits_for(self, number: int, time_s: float) -> str:
        """Why a train gets no authority after a restart; empty if nothing is waited for."""
        place = self._block.place_of(number)
        missing = () if place is None else self._block.missing(place[0], time_s)
        return f"restarted, waits for {', '.join(missing)}" if missing else ""

    def receive(self, base: str, slot: int, frame: bytes, time_ns: int) -> AcceptedReport | None:
        """Take a frame that a base station received in the slot of a train; its report, if any."""
        self._begin(time_ns / NANOSECONDS)
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
        self._begin(time_s)
        caller = self._callers[number]
        if not (isfinite(position_m) and isfinite(variance_m2)):
            return
        sigma_m = sqrt(variance_m2) + _UNSEEN_M / self._sigmas
        accepted = self._block.ranged(number, time_s, segment, position_m, sigma_m)
        # A range on another track is nothing that the telegram can tell.
        if accepted and Trouble.RANGE_SEGMENT not in self._block.troubles(number):
            caller.place = time_s, position_m, self._sigmas * sigma_m

    def telegrams(self, time_ns: int) -> dict[str, list[tuple[int, bytes]]]:
        """Frames for every train, by base station, each with its slot; none between cycles."""
        time_s = time_ns / NANOSECONDS
        self._begin(time_s)
        while self._releases and self._releases[0].at_s <= time_s + 1e-9:
            due = self._releases.pop(0)
            self._block.release(due.number, due.at_s, due.speed_mps + _OVER_ON_SIGHT_MPS)
        out: dict[str, list[tuple[int, bytes]]] = {base: [] for base in self._bases}
        if not self._cycle.begins(time_ns):
            return out
        for number, caller in self._callers.items():
            if caller.leaving and caller.channel.channel.silence_s(time_ns) > _LEFT_S:
                self._block.remove(number)
            located = self._located(number, caller, time_s)
            caller.held = self._block.authority(number, time_s)
            authority = caller.held or self._no_way(number)
            if authority is None:
                continue
            telegram = to_telegram(authority, located)
            frame = caller.channel.channel.seal(
                FrameKind.MOVEMENT_AUTHORITY, telegram.to_bytes(), time_ns
            )
            for base in self._bases if caller.base is None else (caller.base,):
                out[base].append((number, frame))
        return out

    def _located(
        self, number: int, caller: _ConnectedTrain, time_s: float
    ) -> tuple[float, float] | None:
        """Where a train is told that its front is now, and the half-width of that interval."""
        ranged = _now(caller.place, time_s)
        place = self._block.place_of(number)
        between = self._block.front_between(number, time_s)
        if between is None or place is None or place[2]:
            return ranged
        # It does not know where it is: a range that cannot follow from its reports is no help.
        low_m, high_m = between
        if ranged is not None:
            least_m, most_m = ranged[0] - ranged[1], ranged[0] + ranged[1]
            if least_m <= high_m and most_m >= low_m:
                low_m, high_m = max(low_m, least_m), min(high_m, most_m)
        half_m = 0.5 * (high_m - low_m)
        return (low_m + half_m, half_m) if half_m <= WIDEST_M else None

    def _no_way(self, number: int) -> IssuedAuthority | None:
        """Authority that is void from the beginning; it keeps up the channel and tells the place.

        None for a train that is not in service.
        """
        place = self._block.place_of(number)
        if place is None:
            return None
        segment, direction, _ = place
        end_m = direction * FURTHEST_M
        return IssuedAuthority(
            number, segment, direction, end_m, 0.0, (), 0.0, False, False, "no authority"
        )

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
