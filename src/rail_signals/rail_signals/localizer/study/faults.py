"""Faults of one sensor in simulated runs: what it reports instead of what it should.

Each fault begins in every run at a time of its own and lasts. Its size is drawn so that the
logarithm is uniform, from sizes that no one notices to gross ones:

=============  =====================  ======================  ===================  ==============
fault          range                  Doppler                 block                odometer
=============  =====================  ======================  ===================  ==============
bias           1 to 60 m, within      2 to 100 m, within      3 to 150 m           scale 2 to 30 %
               20 s                   20 s                                         within 20 s
drift          0.02 to 1 m/s          0.05 to 1 m/s                                0.02 to 0.5 % a
                                                                                   second
freeze         the last chainage,     the last fix            the last joint       the last speed,
               noise goes on                                                       noise goes on
jump           1 to 500 m             5 to 500 m              20 to 1000 m         0.3 to 15 m/s
come and go    a jump, every 5 to     the same                the same             the same
               30 s on or off
wrong station  the next zone, or the  the next pair, or       the next joint
               other side of mast     mirrored
=============  =====================  ======================  ===================  ==============

All but a freeze and a mirror go either way.
"""

from __future__ import annotations

from enum import Enum
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np

from rail_signals.localizer.filter_bank import BoolArray, FloatArray
from rail_signals.localizer.readings import TickMeasurements
from rail_signals.localizer.settings import Sensor

from .simulation import SimulatedLine

#: One of the readings of a tick.
Reading: TypeAlias = Any


class FaultKind(Enum):
    """Kinds of faults."""

    BIAS = "bias"
    DRIFT = "drift"
    FREEZE = "freeze"
    JUMP = "jump"
    COME_AND_GO = "come and go"
    WRONG_STATION = "wrong station"


class Laws(NamedTuple):
    """Smallest and largest sizes of the faults of a sensor; None = there is no such fault."""

    bias: tuple[float, float]
    bias_within_s: float
    drift_per_s: tuple[float, float] | None
    jump: tuple[float, float]


LAWS: Final = {
    Sensor.RANGE: Laws((1.0, 60.0), 20.0, (0.02, 1.0), (1.0, 500.0)),
    Sensor.DOPPLER: Laws((2.0, 100.0), 20.0, (0.05, 1.0), (5.0, 500.0)),
    Sensor.BLOCK: Laws((3.0, 150.0), 0.0, None, (20.0, 1000.0)),
    Sensor.ODOMETER: Laws((0.02, 0.3), 20.0, (0.0002, 0.005), (0.3, 15.0)),
}
"""The first and the third of the odometer are relative to its speed."""

EFFECT: Final = {
    Sensor.RANGE: 20.0,
    Sensor.DOPPLER: 20.0,
    Sensor.BLOCK: 60.0,
    Sensor.ODOMETER: 3.0,
}
"""A reading that is off by more is to be found [m], of the odometer [m/s]."""

CASES: Final = tuple(
    (sensor, kind)
    for sensor in Sensor
    for kind in FaultKind
    if not (kind is FaultKind.DRIFT and LAWS[sensor].drift_per_s is None)
    and not (kind is FaultKind.WRONG_STATION and sensor is Sensor.ODOMETER)
)
"""Faults that there are."""

_FIELD: Final = {s: s.name.lower() for s in Sensor}
_VALUE: Final = {
    Sensor.RANGE: "chainage_m",
    Sensor.DOPPLER: "chainage_m",
    Sensor.BLOCK: "joint_m",
    Sensor.ODOMETER: "speed_mps",
}


class SensorFault:
    """Falsifies the readings of one sensor.

    Parameters
    ----------
    sensor : Sensor
    kind : FaultKind
    begins_s : float64 [runs]
    line : SimulatedLine
    rng : numpy.random.Generator

    Raises
    ------
    ValueError
        If the sensor has no such fault.
    """

    def __init__(
        self,
        sensor: Sensor,
        kind: FaultKind,
        begins_s: FloatArray,
        line: SimulatedLine,
        rng: np.random.Generator,
    ) -> None:
        if (sensor, kind) not in CASES:
            raise ValueError(f"kind: {sensor.name.lower()} has no fault {kind.value!r}")
        self.sensor, self.kind, self.begins_s = sensor, kind, begins_s[:, None]
        self._line, self._rng = line, rng
        shape, laws = self.begins_s.shape, LAWS[sensor]
        self._sign = rng.choice([-1.0, 1.0], shape)
        self._mirrored = rng.uniform(size=shape) < 0.5
        law = {FaultKind.BIAS: laws.bias, FaultKind.DRIFT: laws.drift_per_s}.get(
            kind, laws.jump
        ) or laws.jump
        smallest, largest = np.log(law).tolist()
        self._size = self._sign * np.exp(rng.uniform(smallest, largest, shape))
        # Lengths of the times on and off, in turn; more than there is time for.
        self._turns_s = np.cumsum(rng.uniform(5.0, 30.0, (shape[0], 100)), axis=1)
        self._held: dict[str, FloatArray] = {}

    def apply(
        self, readings: TickMeasurements, time_s: float
    ) -> tuple[TickMeasurements, FloatArray, FloatArray]:
        """Readings of a tick with the fault, by how much it falsifies them, and what is large.

        The second is 0 where the sensor has no reading in this tick. The third is an error that the
        tests cannot miss when the other sensors are there: `EFFECT`, and eight times the sigma
        that the sensor states, if it does. Both [runs].
        """
        name, value = _FIELD[self.sensor], _VALUE[self.sensor]
        healthy = getattr(readings, name)
        since_s = time_s - self.begins_s
        active = since_s >= 0.0
        if self.kind is FaultKind.COME_AND_GO:
            active = active & ((self._turns_s < since_s).sum(axis=1, keepdims=True) % 2 == 0)
        if self.kind is FaultKind.FREEZE:
            changes = self._frozen(healthy, value, active)
        else:
            changes = {value: getattr(healthy, value) + self._error(healthy, since_s)}
        changes = {
            key: np.where(active, false, getattr(healthy, key)) for key, false in changes.items()
        }
        if self.sensor is Sensor.ODOMETER:
            changes[value] = np.maximum(changes[value], 0.0)
        falsified = np.abs(changes[value] - getattr(healthy, value)) * healthy.present
        faulty = readings._replace(**{name: healthy._replace(**changes)})
        own = 8.0 * np.sqrt(getattr(healthy, "variance_m2", np.zeros_like(falsified)))
        return faulty, falsified[:, 0], (EFFECT[self.sensor] + own)[:, 0]

    def _error(self, healthy: Reading, since_s: FloatArray) -> FloatArray:
        line, laws = self._line, LAWS[self.sensor]
        if self.kind is FaultKind.WRONG_STATION:
            return self._wrong_station(healthy)
        if self.kind is FaultKind.BIAS:
            within_s = max(laws.bias_within_s, line.tick_s)
            size = np.asarray(self._size * np.clip(since_s / within_s, 0.0, 1.0), dtype=np.float64)
        elif self.kind is FaultKind.DRIFT:
            size = np.asarray(self._size * np.maximum(since_s, 0.0), dtype=np.float64)
        else:
            return np.asarray(self._size)
        if self.sensor is Sensor.ODOMETER:
            size = size * np.asarray(healthy.speed_mps)
        return np.asarray(size)

    def _wrong_station(self, healthy: Reading) -> FloatArray:
        line = self._line
        if self.sensor is Sensor.BLOCK:
            return np.asarray(self._sign * line.block_m)
        at_m: FloatArray = healthy.chainage_m
        spacing_m = line.station_m if self.sensor is Sensor.RANGE else line.reference_m
        mast_m = (np.floor(at_m / spacing_m) + 0.5) * spacing_m
        return np.where(self._mirrored, 2.0 * (mast_m - at_m), self._sign * spacing_m)

    def _frozen(self, healthy: Reading, value: str, active: BoolArray) -> dict[str, FloatArray]:
        present = healthy.present
        keys = [value]
        if self.sensor is Sensor.DOPPLER:
            keys = ["chainage_m", "speed_mps"]
        noise = {Sensor.RANGE: 0.1, Sensor.ODOMETER: 0.02}.get(self.sensor, 0.0)
        frozen = {}
        for key in keys:
            now = getattr(healthy, key)
            held = self._held.setdefault(key, now)
            self._held[key] = np.where(present & ~active, now, held)
            frozen[key] = self._held[key] + noise * self._rng.standard_normal(now.shape)
        return frozen
