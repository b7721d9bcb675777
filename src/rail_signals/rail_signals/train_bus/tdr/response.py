"""Time response of a line: the numerical Laplace transform.

A step that reaches a lossy line has a tail that falls with the root of the time: no window is
long enough for an inverse Fourier transform, whose periods then fold onto each other. With the
frequency moved off the axis, ``s = c + j w``, the response is transformed times ``exp(-c t)``,
and what folds back from beyond the window of N samples of dt is smaller by ``exp(-c N dt)``:

    r(n dt) = exp(c n dt) / dt * irfft(R(c + 2 pi j k / (N dt))),   k = 0 ... N/2.

So the window need only be as long as the part that is looked at. One transform gives impulse,
step and pulse alike; what starts an instant before 0 appears at the end of the window.

The incident wave has Gaussian edges: a step that rises from 10 to 90 % in the rise time
``t_r = 2.5631 sigma``, or a pulse with that step's derivative as shape and peak 1, both around
``t = 0``. Their spectrum is ``exp((sigma s)^2 / 2)`` over s, or times ``sqrt(2 pi) sigma``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np
from scipy import fft

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.bus_line import BusLine
from rail_signals.train_bus.cascade import reflection_at

RISE_PER_SIGMA: Final = 2.5631031310892007
"""10 to 90 % rise time of a Gaussian edge over its standard deviation."""

SAMPLES_PER_RISE: Final = 4.0
"""Samples in a rise time for which nothing of weight is left above half the sample rate."""

_FOLD: Final = 13.0
"""Nepers by which the damping lowers what folds back."""

_GUARD: Final = 0.25
"""Fraction of the transform behind the part that is used: there the damping would lift rounding."""

Excitation = Literal["step", "pulse"]


@dataclass(frozen=True)
class TimeGrid:
    """Samples of a response and the complex frequencies they are computed from.

    Parameters
    ----------
    samples
        Samples from `start_s` on.
    sample_period_s
        Time between them dt [s].
    start_s
        Time of the first sample [s]; 0 is when the middle of the edge enters the line.
    """

    samples: int
    sample_period_s: float
    start_s: float = 0.0

    def __post_init__(self) -> None:
        """Validate."""
        if self.samples < 2:
            raise ValueError(f"samples must be 2 or more, got {self.samples!r}")
        if not (math.isfinite(self.sample_period_s) and self.sample_period_s > 0):
            raise ValueError(f"sample_period_s must be above 0, got {self.sample_period_s!r}")
        if not math.isfinite(self.start_s):
            raise ValueError(f"start_s must be finite, got {self.start_s!r}")

    @property
    def time_s(self) -> FloatArray:
        """Time of each sample [s]: [samples]."""
        return np.asarray(self.start_s + np.arange(self.samples) * self.sample_period_s)

    @cached_property
    def transform_length(self) -> int:
        """Samples N of the transform, more than are wanted by a guard."""
        return int(fft.next_fast_len(math.ceil(self.samples / (1 - _GUARD)), real=True))

    @property
    def damping_per_s(self) -> float:
        """Real part c of the frequencies [1/s]."""
        return _FOLD / (self.transform_length * self.sample_period_s)

    def laplace_axis(self) -> ComplexArray:
        """Complex frequencies [rad/s]: [N // 2 + 1]."""
        length = self.transform_length
        step = 2 * math.pi / (length * self.sample_period_s)
        return np.asarray(self.damping_per_s + 1j * step * np.arange(length // 2 + 1))

    def to_time(self, response: ComplexArray, scratch: FloatArray | None = None) -> FloatArray:
        """Samples of responses given over :meth:`laplace_axis`.

        Parameters
        ----------
        response : complex [..., N // 2 + 1]
            Laplace transforms, their time counted from `start_s`.
        scratch : float64 [..., N], optional
            Memory to work in.

        Returns
        -------
        float64 [..., samples]
        """
        rows = np.fft.irfft(response, self.transform_length, axis=-1, out=scratch)
        return np.asarray(rows[..., : self.samples] * self.growth)

    @cached_property
    def growth(self) -> FloatArray:
        """Factor ``exp(c t) / dt`` that undoes the damping: [samples]."""
        time = np.arange(self.samples) * self.sample_period_s
        return np.asarray(np.exp(self.damping_per_s * time) / self.sample_period_s)


def incident_spectrum(
    grid: TimeGrid, rise_time_s: float, excitation: Excitation = "step"
) -> ComplexArray:
    """Laplace transform of the incident wave over a grid, delayed to its start: [N // 2 + 1].

    Raises
    ------
    ValueError
        If the grid is too coarse for the rise time, starts in the edge, or a value is wrong.
    """
    if not (math.isfinite(rise_time_s) and rise_time_s > 0):
        raise ValueError(f"rise_time_s must be above 0, got {rise_time_s!r}")
    coarsest = rise_time_s / SAMPLES_PER_RISE * (1 + 1e-9)
    if grid.sample_period_s > coarsest:
        raise ValueError(
            f"sample_period_s must be at most a quarter of the rise time {rise_time_s:g} s,"
            f" got {grid.sample_period_s!r}"
        )
    if excitation not in ("step", "pulse"):
        raise ValueError(f"excitation must be 'step' or 'pulse', got {excitation!r}")
    sigma = rise_time_s / RISE_PER_SIGMA
    s = grid.laplace_axis()
    edge = np.exp((sigma * s) ** 2 / 2 + s * grid.start_s)
    return np.asarray(edge / s if excitation == "step" else edge * (sigma * math.sqrt(2 * math.pi)))


def lead_in_s(rise_time_s: float) -> float:
    """Time before the middle of the edge at which it has not begun to one in a million [s]."""
    return 5.0 * rise_time_s / RISE_PER_SIGMA


def reflected_wave(
    bus_line: BusLine,
    grid: TimeGrid,
    reference_ohm: float,
    rise_time_s: float,
    excitation: Excitation = "step",
) -> FloatArray:
    """What comes back from the head of a line, over the size of the incident wave.

    Parameters
    ----------
    bus_line
        The line.
    grid
        Samples; they should begin :func:`lead_in_s` before 0.
    reference_ohm
        Impedance of the source and of the wave [ohm].
    rise_time_s
        Rise time of the incident edge, 10 to 90 % [s].
    excitation
        A step or a pulse.

    Returns
    -------
    float64 [samples]
    """
    spectrum = incident_spectrum(grid, rise_time_s, excitation)
    return grid.to_time(reflection_at(bus_line, grid.laplace_axis(), reference_ohm) * spectrum)
