"""Simulated runs of trains and what their sensors would report, for measuring integrity.

The world is not the filters' model of it, as it never is: speeds follow a driver who brakes and
stands, not a Gauss-Markov process; wheels creep in proportion to the effort and slip in episodes;
block entries are noticed late by a uniform time; readings fail to come, by outages and by the
geometry. All runs [...] advance together.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.localizer.filter_bank import BoolArray, FloatArray
from rail_signals.localizer.readings import (
    BlockEntry,
    DopplerFix,
    RangeFix,
    TickMeasurements,
    WheelSpeed,
)


@dataclass(frozen=True)
class SimulatedLine:
    """What is along the line and how its sensors err; pairs are the ends of uniform laws.

    Parameters
    ----------
    tick_s : float
    station_m : float
        Length of a ranging zone, its station in the middle.
    range_sigma_m : (float, float)
        Noise, of a run.
    range_bias_m, range_bias_length_m : float
        Sigma of the bias of a station, and the distance over which it changes.
    most_late : int
        Ticks by which a range comes late at most.
    reference_m, offset_m : float
        Distance of the reference stations along the line, and their offset from it.
    carrier_hz, frequency_sigma_hz : float
    doppler_bias : float
        Sigma of the lasting error of a Doppler position over that of its noise.
    doppler_bias_length_m : float
    least_speed_mps, widest_m : float
        Slower than this, or with a larger sigma, there is no Doppler fix.
    block_m, detection_s : float
    wheel_scale, wheel_noise_mps : float
        Sigma of the wheels' scale, cut off at three, and of their noise.
    creep_s : float
        Creep of the wheels over speed times acceleration [s^2/m].
    slips_per_s : float
        How often wheels begin to slip while the acceleration is large.
    outages_per_s, outage_s : float, (float, float)
        How often ranges and Doppler fixes fail, and for how long.
    """

    tick_s: float = 0.1
    station_m: float = 1500.0
    range_sigma_m: tuple[float, float] = (0.1, 0.3)
    range_bias_m: float = 0.3
    range_bias_length_m: float = 500.0
    most_late: int = 3
    reference_m: float = 1000.0
    offset_m: float = 50.0
    carrier_hz: float = 2.6e9
    frequency_sigma_hz: float = 1.0
    doppler_bias: float = 1.0
    doppler_bias_length_m: float = 300.0
    least_speed_mps: float = 2.0
    widest_m: float = 50.0
    block_m: float = 1500.0
    detection_s: float = 0.5
    wheel_scale: float = 0.01
    wheel_noise_mps: float = 0.03
    creep_s: float = 0.01
    slips_per_s: float = 0.05
    outages_per_s: float = 1.0 / 120.0
    outage_s: tuple[float, float] = (2.0, 15.0)


class Truth(NamedTuple):
    """Chainage, speed and acceleration along it [...]."""

    chainage_m: FloatArray
    speed_mps: FloatArray
    acceleration_mps2: FloatArray


class SimulatedMotion:
    """Drivers: a speed is chosen every now and then, a fifth of the times it is a stand."""

    _RISE_S = 1.5

    def __init__(self, runs: int, direction: int, tick_s: float, rng: np.random.Generator) -> None:
        self._tick_s, self._direction, self._rng = tick_s, direction, rng
        self._path_m = rng.uniform(10e3, 20e3, runs)
        self._speed_mps = self._chosen(runs)
        self._wanted_mps = self._speed_mps.copy()
        self._acceleration = np.zeros(runs)
        self._left_s = rng.uniform(0.0, 30.0, runs)
        self._sign = float(direction)

    def _chosen(self, runs: int) -> FloatArray:
        standing = self._rng.uniform(size=runs) < 0.2
        return np.where(standing, 0.0, self._rng.uniform(5.0, 40.0, runs))

    def step(self) -> Truth:
        """Advance by a tick."""
        dt, rng, runs = self._tick_s, self._rng, self._path_m.size
        self._left_s -= dt
        due = self._left_s <= 0.0
        if due.any():
            self._wanted_mps = np.where(due, self._chosen(runs), self._wanted_mps)
            self._left_s = np.where(due, rng.uniform(15.0, 60.0, runs), self._left_s)
        wanted = np.clip((self._wanted_mps - self._speed_mps) / self._RISE_S, -1.0, 0.8)
        self._acceleration += np.clip(wanted - self._acceleration, -dt, dt)
        speed = self._speed_mps + self._acceleration * dt
        stands = (speed <= 0.0) | ((self._wanted_mps == 0.0) & (speed < 0.02))
        speed = np.where(stands, 0.0, speed)
        self._acceleration = np.where(stands, 0.0, self._acceleration)
        self._path_m += 0.5 * (self._speed_mps + speed) * dt
        self._speed_mps = speed
        sign = self._sign
        return Truth(sign * self._path_m, sign * speed, sign * self._acceleration)


class Drifting:
    """Errors that change with the distance run: Gauss-Markov, of variance one."""

    def __init__(self, runs: int, length_m: float, rng: np.random.Generator) -> None:
        self._rng, self._length_m = rng, length_m
        self.value = rng.standard_normal(runs)

    def step(self, distance_m: FloatArray, renewed: BoolArray | None = None) -> FloatArray:
        """Advance by a distance; anew where `renewed`."""
        kept = np.exp(-distance_m / self._length_m)
        if renewed is not None:
            kept = np.where(renewed, 0.0, kept)
        fresh = self._rng.standard_normal(self.value.size)
        self.value = kept * self.value + np.sqrt(1.0 - kept * kept) * fresh
        return self.value


class Outages:
    """Times without readings."""

    def __init__(
        self, runs: int, per_s: float, lasting_s: tuple[float, float], rng: np.random.Generator
    ) -> None:
        self._per_s, self._lasting_s, self._rng = per_s, lasting_s, rng
        self._left_s = np.zeros(runs)

    def step(self, tick_s: float) -> BoolArray:
        """Which runs have an outage in this tick."""
        runs = self._left_s.size
        begins = self._rng.uniform(size=runs) < self._per_s * tick_s
        lasting_s = self._rng.uniform(*self._lasting_s, runs)
        self._left_s = np.where(begins, lasting_s, self._left_s - tick_s)
        return self._left_s > 0.0


class Slips:
    """Episodes in which wheels turn faster than the train pulls, or slower than it brakes."""

    def __init__(self, runs: int, per_s: float, rng: np.random.Generator) -> None:
        self._per_s, self._rng = per_s, rng
        self._left_s, self._rate, self._most, self._now = np.zeros((4, runs))

    def step(self, speed_mps: FloatArray, acceleration: FloatArray, tick_s: float) -> FloatArray:
        """Speed by which the wheels are too fast (magnitudes in)."""
        rng, runs = self._rng, speed_mps.size
        begins = rng.uniform(size=runs) < self._per_s * tick_s
        begins &= (np.abs(acceleration) > 0.6) & (self._left_s <= 0.0)
        most = rng.uniform(0.05, 0.3, runs) * np.sign(acceleration)
        rise_s, lasting_s = rng.uniform(0.3, 1.0, runs), rng.uniform(1.0, 4.0, runs)
        self._most = np.where(begins, most, self._most)
        self._rate = np.where(begins, np.abs(most) / rise_s, self._rate)
        self._left_s = np.where(begins, lasting_s, self._left_s - tick_s)
        goal = np.where(self._left_s > 0.0, self._most, 0.0)
        change = np.clip(goal - self._now, -self._rate * tick_s, self._rate * tick_s)
        self._now = self._now + change
        return self._now * speed_mps


def doppler_covariance(
    line: SimulatedLine, chainage_m: FloatArray, speed_mps: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Errors of position and speed for each hertz at the two reference stations about a train.

    Each station hears ``f = f0 / c v (X - x) / r``; both unknowns from two of them are the
    solution of a system of two equations.

    Returns
    -------
    inverse : float64 [2, 2, ...]
        Of the Jacobian: from two frequency errors [Hz] to errors of position [m] and speed [m/s].
    covariance : float64 [2, 2, ...]
        For the frequency error of the line.

    Examples
    --------
    >>> line = SimulatedLine()
    >>> at = np.array([500.0, 750.0, 900.0])
    >>> _, covariance = doppler_covariance(line, at, np.full(3, 300 / 3.6))
    >>> np.sqrt(covariance[0, 0]).round(2).tolist()
    [49.66, 12.38, 1.04]
    """
    first_m = np.floor(chainage_m / line.reference_m) * line.reference_m
    along_m = np.stack([first_m, first_m + line.reference_m]) - chainage_m
    away_m = np.hypot(along_m, line.offset_m)
    scale = line.carrier_hz / SPEED_OF_LIGHT_M_PER_S
    by_speed = scale * along_m / away_m
    by_place = -scale * speed_mps * line.offset_m**2 / away_m**3
    determinant = by_place[0] * by_speed[1] - by_place[1] * by_speed[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.stack([[by_speed[1], -by_speed[0]], [-by_place[1], by_place[0]]]) / determinant
    covariance = line.frequency_sigma_hz**2 * np.einsum("ij...,kj...->ik...", inverse, inverse)
    return inverse, covariance


class SimulatedSensors:
    """What the sensors of all runs report in a tick, without faults.

    Parameters
    ----------
    line : SimulatedLine
    runs, direction : int
    rng : numpy.random.Generator
    """

    def __init__(
        self, line: SimulatedLine, runs: int, direction: int, rng: np.random.Generator
    ) -> None:
        self._line, self._rng, self._direction = line, rng, direction
        self._range_sigma_m = rng.uniform(*line.range_sigma_m, runs)
        self._late = rng.integers(0, line.most_late + 1, runs)
        self._past_m: list[FloatArray] = []
        self._range_bias = Drifting(runs, line.range_bias_length_m, rng)
        self._doppler_bias = Drifting(runs, line.doppler_bias_length_m, rng)
        self._range_out = Outages(runs, line.outages_per_s, line.outage_s, rng)
        self._doppler_out = Outages(runs, line.outages_per_s, line.outage_s, rng)
        self._slips = Slips(runs, line.slips_per_s, rng)
        cut = np.clip(rng.standard_normal(runs), -3.0, 3.0)
        self._scale = line.wheel_scale * cut
        self._joint_offset_m = rng.uniform(0.0, line.block_m, runs)
        self._notice_s = np.full(runs, -1.0)
        self._joint_m = np.zeros(runs)
        self._station: FloatArray | None = None

    def read(self, truth: Truth) -> TickMeasurements:
        """Readings of a tick."""
        self._past_m = [truth.chainage_m, *self._past_m[: self._line.most_late]]
        distance_m = np.abs(truth.chainage_m - self._past_m[min(1, len(self._past_m) - 1)])
        return TickMeasurements(
            self._range(truth, distance_m),
            self._doppler(truth, distance_m),
            self._block(truth),
            self._odometer(truth),
        )

    def _range(self, truth: Truth, distance_m: FloatArray) -> RangeFix:
        line, runs = self._line, truth.chainage_m.size
        late = np.minimum(self._late, len(self._past_m) - 1)
        at_m = np.stack(self._past_m)[late, np.arange(runs)]
        station = np.floor(at_m / line.station_m)
        changed = np.zeros(runs, np.bool_) if self._station is None else station != self._station
        self._station = station
        bias_m = line.range_bias_m * self._range_bias.step(distance_m, changed)
        noise_m = self._range_sigma_m * self._rng.standard_normal(runs)
        present = ~(self._range_out.step(line.tick_s) | changed)
        return RangeFix(
            (at_m + bias_m + noise_m)[:, None],
            np.square(self._range_sigma_m)[:, None],
            (late * line.tick_s)[:, None],
            station[:, None],
            present[:, None],
        )

    def _doppler(self, truth: Truth, distance_m: FloatArray) -> DopplerFix:
        line, runs = self._line, truth.chainage_m.size
        inverse, covariance = doppler_covariance(line, truth.chainage_m, truth.speed_mps)
        there = np.abs(truth.speed_mps) >= line.least_speed_mps
        there &= covariance[0, 0] <= line.widest_m**2
        covariance = np.where(there, covariance, np.eye(2)[:, :, None])
        shifts_hz = line.frequency_sigma_hz * self._rng.standard_normal((2, runs))
        error = np.einsum("ij...,j...->i...", np.where(there, inverse, 0.0), shifts_hz)
        lasting = line.doppler_bias * self._doppler_bias.step(distance_m)
        error = error + lasting * covariance[0] / np.sqrt(covariance[0, 0])
        present = there & ~self._doppler_out.step(line.tick_s)
        return DopplerFix(
            (truth.chainage_m + error[0])[:, None],
            (truth.speed_mps + error[1])[:, None],
            covariance[0, 0][:, None],
            covariance[0, 1][:, None],
            covariance[1, 1][:, None],
            np.zeros((runs, 1)),
            present[:, None],
        )

    def _block(self, truth: Truth) -> BlockEntry:
        line, runs = self._line, truth.chainage_m.size
        before_m = self._past_m[min(1, len(self._past_m) - 1)]
        block = np.floor(
            (np.stack([before_m, truth.chainage_m]) - self._joint_offset_m) / line.block_m
        )
        joint_m = block.max(axis=0) * line.block_m + self._joint_offset_m
        with np.errstate(divide="ignore", invalid="ignore"):
            passed = (joint_m - before_m) / (truth.chainage_m - before_m)
        # Times count from the end of this tick.
        notice_s = (passed - 1.0) * line.tick_s + self._rng.uniform(0.0, line.detection_s, runs)
        entered = block[0] != block[1]
        self._joint_m = np.where(entered, joint_m, self._joint_m)
        waiting = self._notice_s > 0.0
        left_s = np.where(waiting, self._notice_s - line.tick_s, -1.0)
        left_s = np.where(entered, notice_s, left_s)
        present = (entered | waiting) & (left_s <= 0.0)
        self._notice_s = left_s
        age_s = np.where(present, -left_s, 0.0)
        return BlockEntry(self._joint_m[:, None].copy(), age_s[:, None], present[:, None])

    def _odometer(self, truth: Truth) -> WheelSpeed:
        line, runs = self._line, truth.chainage_m.size
        speed_mps = np.abs(truth.speed_mps)
        pull = self._direction * truth.acceleration_mps2
        slip_mps = self._slips.step(speed_mps, pull, line.tick_s)
        noise_mps = line.wheel_noise_mps * self._rng.standard_normal(runs) * (speed_mps > 0.0)
        wheel_mps = speed_mps * (1.0 + self._scale + line.creep_s * pull) + slip_mps + noise_mps
        zeros, on = np.zeros((runs, 1)), np.ones((runs, 1), np.bool_)
        return WheelSpeed(np.maximum(wheel_mps, 0.0)[:, None], zeros, on)
