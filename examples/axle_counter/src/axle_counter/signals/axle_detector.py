"""From the sampled amplitudes of two coils to axles and their direction.

Each coil has a threshold and a lower one to release it. The two together are in one of four
phases, which a wheel that passes forward goes through in the order 0 - 1 - 2 - 3 - 0:

| phase | 0 | 1 | 2 | 3 |
|---|---|---|---|---|
| coil 1 | off | on | on | off |
| coil 2 | off | off | on | on |

Steps forward count +1, steps back -1. When the sensor is clear again their sum is +4 for an axle
that has passed forward, -4 for one that has passed backward, and 0 for one that has gone back
where it came from - whatever the wheel did in between. A step over two phases has no direction:
the passage is *unclear*, and so is one whose begin was not seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .wheel_sensor import WheelSensor

_PHASES: Final = np.array([[0, 3], [1, 2]])
#: An amplitude outside these fractions of that at rest is no amplitude of a coil.
_LEAST, _MOST = 0.2, 1.5


@dataclass(frozen=True)
class Passages:
    """What a block of samples showed.

    Parameters
    ----------
    forward, backward : int
        Axles that have passed, each way.
    unclear : int
        Passages of which it cannot be told whether there was an axle, or which way it went.
    busy : bool
        Whether a wheel is on the sensor at the end of the block.
    valid : bool
        Whether the coils work.
    """

    forward: int
    backward: int
    unclear: int
    busy: bool
    valid: bool


class AxleDetector:
    """Detects axles in blocks of samples that follow each other without a gap.

    Parameters
    ----------
    sensor : WheelSensor
    """

    def __init__(self, sensor: WheelSensor) -> None:
        self._on_below_v = sensor.rest_v - sensor.threshold * sensor.depth_v
        self._off_above_v = sensor.rest_v - sensor.release * sensor.depth_v
        self._least_v, self._most_v = _LEAST * sensor.rest_v, _MOST * sensor.rest_v
        self._on = np.zeros(2, dtype=np.int8)
        self._phase = 0
        self._steps = 0
        # What was before the first sample is not known: a wheel may stand on the sensor.
        self._begun = False
        self._unclear = False

    def feed(self, amplitudes_v: NDArray[np.float64]) -> Passages:
        """Passages in the next samples [coil, sample] [V]."""
        low, high = amplitudes_v.min(initial=np.inf), amplitudes_v.max(initial=-np.inf)
        if not (low >= self._least_v and high <= self._most_v):  # nor is NaN
            self._unclear = True
            return Passages(0, 0, 0, busy=self._phase != 0, valid=False)
        quiet = self._begun and self._phase == 0 and not self._unclear
        if quiet and low > self._on_below_v:
            return Passages(0, 0, 0, busy=False, valid=True)
        return self._follow(self._phases(amplitudes_v))

    def _phases(self, amplitudes_v: NDArray[np.float64]) -> NDArray[np.intp]:
        """Phase [sample]; carries the state of the coils on to the next block."""
        count = amplitudes_v.shape[1]
        decided = np.full((2, count + 1), -1, dtype=np.int8)
        decided[:, 0] = self._on
        decided[:, 1:][amplitudes_v < self._on_below_v] = 1
        decided[:, 1:][amplitudes_v > self._off_above_v] = 0
        # Between the thresholds a coil stays what the last decisive sample made it.
        last = np.maximum.accumulate(np.where(decided >= 0, np.arange(count + 1), 0), axis=1)
        on = np.take_along_axis(decided, last, axis=1)[:, 1:]
        self._on = on[:, -1].copy()
        return np.asarray(_PHASES[on[0], on[1]], dtype=np.intp)

    def _follow(self, phases: NDArray[np.intp]) -> Passages:
        forward = backward = unclear = 0
        if not self._begun:
            self._begun = True
            self._phase = int(phases[0])
            self._unclear = self._phase != 0
        changes = np.flatnonzero(np.diff(phases, prepend=self._phase))
        for phase in phases[changes].tolist():
            step = (phase - self._phase) % 4
            self._phase = phase
            self._unclear |= step == 2
            self._steps += (0, 1, 0, -1)[step]
            if phase:
                continue
            forward += self._steps == 4 and not self._unclear
            backward += self._steps == -4 and not self._unclear
            unclear += self._unclear
            self._steps, self._unclear = 0, False
        if not self._phase and self._unclear:  # the coils have failed, and work again
            unclear += 1
            self._steps, self._unclear = 0, False
        return Passages(forward, backward, unclear, busy=self._phase != 0, valid=True)
