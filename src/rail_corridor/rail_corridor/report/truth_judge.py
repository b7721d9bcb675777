"""A run judged by where trains truly were: collisions, ends, speed, false claims, standstill.

A second opinion beside the counters of the equipment: it knows arrays alone, and shares no code
with what it judges. All places are chainages of one track, so that a train lies in one interval of
it; trains on other tracks do not meet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rail_signals.arrays import BoolArray, FloatArray

#: Speed above the limit that counts [m/s].
OVERSPEED_MPS: Final = 0.5
#: A train within this of its destination is there [m].
ARRIVED_M: Final = 5.0
#: One that stands within this of a train that is at its destination waits for its place [m].
QUEUE_M: Final = 100.0
#: A train that goes on moves by this [m], in the last part of the time that it has for it.
MOVED_M, MOVED_PART = 1.0, 0.5
#: What is moved by rounding alone [m].
_ROUNDING_M: Final = 1e-6


@dataclass(frozen=True)
class Motion:
    """True motion of the trains of a run.

    Parameters
    ----------
    tick_s : float
    track : array [tick, train]
        Place of the track in the order of the scenario.
    front_m : array [tick, train]
        Chainage of the end that leads [m].
    speed_mps : array [tick, train]
        Positive towards greater chainage.
    on_line : array of bool [tick, train]
    length_m : array [train]
    direction : array [train]
        1 or -1.
    """

    tick_s: float
    track: FloatArray
    front_m: FloatArray
    speed_mps: FloatArray
    on_line: BoolArray
    length_m: FloatArray
    direction: FloatArray

    @property
    def rear_m(self) -> FloatArray:
        """Chainage of the other end [tick, train]."""
        return np.asarray(self.front_m - self.direction * self.length_m)

    @property
    def low_m(self) -> FloatArray:
        """Lesser chainage of the two ends [tick, train]."""
        return np.minimum(self.front_m, self.rear_m)

    @property
    def high_m(self) -> FloatArray:
        """Greater chainage of the two ends [tick, train]."""
        return np.maximum(self.front_m, self.rear_m)

    @property
    def moves(self) -> BoolArray:
        """Whether it moves [tick, train]."""
        return np.asarray(self.on_line & (np.abs(self.speed_mps) > 0.0))


@dataclass(frozen=True)
class Collision:
    """Two trains in one place.

    Parameters
    ----------
    tick : int
        The first one.
    trains : tuple of int
    deepest_m : float
        Greatest overlap, infinite if they changed places between two ticks.
    """

    tick: int
    trains: tuple[int, int]
    deepest_m: float


def collisions(motion: Motion) -> list[Collision]:
    """Pairs of trains that were in one place, or on the other side of each other a tick later."""
    low_m, high_m, found = motion.low_m, motion.high_m, []
    for one in range(len(motion.length_m)):
        for other in range(one):
            together = motion.on_line[:, one] & motion.on_line[:, other]
            together &= motion.track[:, one] == motion.track[:, other]
            overlap_m = np.minimum(high_m[:, one], high_m[:, other]) - np.maximum(
                low_m[:, one], low_m[:, other]
            )
            side = np.sign(motion.front_m[:, one] - motion.front_m[:, other])
            changed = np.zeros(len(side), dtype=bool)
            changed[1:] = together[1:] & together[:-1] & (side[1:] * side[:-1] < 0.0)
            hit = (together & (overlap_m > _ROUNDING_M)) | changed
            if hit.any():
                deepest_m = math.inf if changed.any() else float(overlap_m[hit].max())
                found.append(Collision(int(np.argmax(hit)), (other, one), deepest_m))
    return found


@dataclass(frozen=True)
class StoppingWay:
    """What a train may take to a stand when its authority is taken away.

    Parameters
    ----------
    delay_s : float
        Until the brake holds, with an authority that is shortened.
    silence_s : float
        Further time for which an authority holds of which nothing more is heard.
    braking_mps2 : float
        Guaranteed, on the steepest fall.
    pull_mps2 : float
        Greatest acceleration until then.
    """

    delay_s: float
    silence_s: float
    braking_mps2: float
    pull_mps2: float

    def way_m(self, speed_mps: float, silent: bool) -> float:
        """Way to a stand [m]."""
        delay_s = self.delay_s + (self.silence_s if silent else 0.0)
        fastest_mps = speed_mps + self.pull_mps2 * delay_s
        gathered_m = 0.5 * (speed_mps + fastest_mps) * delay_s
        return gathered_m + 0.5 * fastest_mps * fastest_mps / self.braking_mps2


def passed_ends(
    motion: Motion, end_m: FloatArray, stopping: StoppingWay, excused: BoolArray
) -> BoolArray:
    """Ticks in which a train moved with its front beyond the end of its authority [tick, train].

    An end that is taken back, or not issued any more (NaN), binds a train from where it can have
    stopped on; a train that stands then is bound by it once the old one has run out.

    Parameters
    ----------
    motion : Motion
    end_m : array [tick, train]
        Chainage as issued by the wayside; NaN while none is.
    stopping : StoppingWay
    excused : array of bool [tick, train]
        Whether a person lets the train run on sight.
    """
    passed = np.zeros(motion.on_line.shape, dtype=bool)
    for train, direction in enumerate(motion.direction.tolist()):
        front = (direction * motion.front_m[:, train]).tolist()
        end = (direction * end_m[:, train]).tolist()
        speed = np.abs(motion.speed_mps[:, train]).tolist()
        allowed = hold = -math.inf
        since = 0
        for tick in np.flatnonzero(motion.on_line[:, train]).tolist():
            silent = math.isnan(end[tick])
            now = -math.inf if silent else end[tick]
            if now >= allowed:
                allowed, hold = now, math.inf
            else:
                if hold == math.inf:
                    hold, since = front[tick] + stopping.way_m(speed[tick], silent), tick
                holds_s = stopping.delay_s + stopping.silence_s
                over = speed[tick] == 0.0 and (tick - since) * motion.tick_s > holds_s
                allowed = now if over else max(now, min(allowed, hold))
            passed[tick, train] = speed[tick] > 0.0 and front[tick] > allowed + _ROUNDING_M
    return np.asarray(passed & ~excused)


def passed_tails(motion: Motion, rear_m: FloatArray) -> BoolArray:
    """Ticks in which the rear was behind where the wayside has others run to [tick, train].

    Parameters
    ----------
    rear_m : array [tick, train]
        Hindmost chainage at which the wayside takes the rear to be; NaN where it does not know.
    """
    behind_m = motion.direction * (rear_m - motion.rear_m)
    return np.asarray(motion.on_line & (behind_m > _ROUNDING_M))


def least_limits(
    low_m: FloatArray, high_m: FloatArray, starts_m: FloatArray, limits_mps: FloatArray
) -> FloatArray:
    """Least limit under trains from ``low_m`` to ``high_m`` [...].

    Parameters
    ----------
    low_m, high_m : array [...]
    starts_m, limits_mps : array [step]
        Chainage from which each limit holds, increasing, and the limit.
    """
    ends_m = np.append(starts_m[1:], math.inf)
    under = (starts_m < high_m[..., None]) & (ends_m > low_m[..., None])
    return np.asarray(np.where(under, limits_mps, math.inf).min(axis=-1, initial=math.inf))


def overspeed(motion: Motion, limit_mps: FloatArray) -> BoolArray:
    """Ticks in which any axle was too fast [tick, train]; of limits under the whole train."""
    too_fast = np.abs(motion.speed_mps) > limit_mps + OVERSPEED_MPS
    return np.asarray(motion.on_line & too_fast)


def mislocated(
    motion: Motion, low_m: FloatArray, high_m: FloatArray, claimed: BoolArray
) -> BoolArray:
    """Ticks in which a claimed interval did not hold the true front [tick, train].

    One that is no number holds nothing; where ``claimed`` is False nothing was claimed.
    """
    holds = (low_m <= motion.front_m + _ROUNDING_M) & (motion.front_m - _ROUNDING_M <= high_m)
    return np.asarray(motion.on_line & claimed & ~holds)


def stuck(motion: Motion, destination_m: FloatArray, from_tick: int, to_tick: int) -> list[int]:
    """Trains that do not run by the end of the time that they have for going on again.

    A train runs if it has moved in the last part of that time. One that is at its destination, has
    left the line or stands behind such a one need not.

    Parameters
    ----------
    motion : Motion
    destination_m : array [train]
        Chainage of the last stop.
    from_tick, to_tick : int
        The time from the end of the last fault on.
    """
    to_tick = min(to_tick, len(motion.front_m) - 1)
    look = max(0, min(to_tick - 1, round(from_tick + (1.0 - MOVED_PART) * (to_tick - from_tick))))
    front_m = motion.front_m
    here = motion.on_line[to_tick]
    run = np.abs(front_m[to_tick] - front_m[look]) >= MOVED_M
    left = motion.direction * (destination_m - front_m[to_tick])
    done = ~here | (np.abs(left) <= ARRIVED_M)
    # From the foremost on: who stands behind one that is where it should be waits for its place.
    for train in np.argsort(left).tolist():
        for other in np.flatnonzero(done & here).tolist():
            same = motion.direction[other] == motion.direction[train]
            gap_m = motion.direction[train] * (
                motion.rear_m[to_tick, other] - front_m[to_tick, train]
            )
            done[train] |= bool(same and 0.0 <= gap_m <= QUEUE_M)
    return [int(train) for train in np.flatnonzero(~done & ~run)]
