"""What several traces of the same line tell together: noise, and whether something changes.

Between traces the line stays what it is, unless a contact is loose. What differs between them
is noise, of the same power everywhere, or one waveform with a factor that changes from trace to
trace.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray

from .reflectometer import Reflectogram

_ORDER = 4
_MEDIAN_OF_NORMAL = 0.6744897501960817
_FALSE_CHANGE = 1e-4


@dataclass(frozen=True)
class TraceSummary:
    """Traces of a line, brought together.

    Parameters
    ----------
    mean : float64 [samples]
        Their mean.
    noise_rms
        Noise of one sample of one trace.
    noise_std
        Standard error of `noise_rms`, relative.
    change : float64 [samples] or None
        The waveform by which the traces differ, over the noise: its squared length is the power
        of the change in all traces. None where there is but noise.
    highest : float64 [samples]
        The trace in which the reflection is highest.
    traces
        How many there are.
    """

    mean: FloatArray
    noise_rms: float
    noise_std: float
    change: FloatArray | None
    highest: FloatArray
    traces: int


def summarise(reflectogram: Reflectogram) -> TraceSummary:
    """Mean, noise and change of the traces of a reflectogram."""
    rows = reflectogram.reflection
    noise = noise_level(rows)
    mean = rows.mean(axis=0)
    apart = rows - mean
    # Standard error of a median of squares, the differences overlapping.
    error = 1.2 * math.sqrt(_ORDER / rows.size)
    highest = rows[int(np.argmax(apart.sum(axis=1)))]
    return TraceSummary(mean, noise, error, _change(apart, noise), highest, len(rows))


def noise_level(rows: FloatArray) -> float:
    """Standard deviation of white noise on smooth traces, from their fourth differences.

    The median of their size does not see the few samples near an edge.

    Parameters
    ----------
    rows : float64 [traces, samples]
        The traces.
    """
    differences = np.abs(np.diff(rows, _ORDER, axis=-1))
    gain = math.sqrt(math.comb(2 * _ORDER, _ORDER))
    return float(np.median(differences, axis=-1).mean() / (_MEDIAN_OF_NORMAL * gain))


def _change(apart: FloatArray, noise: float) -> FloatArray | None:
    """The one waveform that explains how traces differ, if it is more than noise.

    The largest singular value of m rows of N white samples exceeds ``sqrt(N) + sqrt(m) + t``
    with a probability of at most ``exp(-t^2 / 2)``.
    """
    traces, samples = apart.shape
    if traces < 2 or noise <= 0:
        return None
    powers, directions = np.linalg.eigh(apart @ apart.T / noise**2)
    beyond = math.sqrt(2 * math.log(1 / _FALSE_CHANGE))
    # A tenth more for what the noise itself is not known to.
    limit = 1.1 * (math.sqrt(samples) + math.sqrt(traces - 1) + beyond) ** 2
    if powers[-1] <= limit:
        return None
    return np.asarray(directions[:, -1] @ apart / noise)
