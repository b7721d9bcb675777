"""Fit a train from its head on, window by window.

What a trace shows up to a time depends on the line up to half the way travelled in it. So a fit
of the first runs of cable is a problem of its own, and a good start for a longer window: delays
that are off by many rise times at the far end are found while they still are off by little. And
if a window does not fit, the fault lies where the line first differs from its drawing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.consist import COMMON, Consist

from .backscatter import Metric
from .fit import Fit, fit
from .model import TraceModel
from .parts import FaultGuess
from .projection import Projection
from .reflectometer import Reflectometer

_STRIDE = 1.7
_BEYOND_RISES = 2.0
_EXCESS_SIGMAS = 6.0
_EXCESS_LEAST = 12.0
_BATCH_DELAYS = np.linspace(-3.6, 3.6, 13)


class Windows:
    """The windows of one trace and their models.

    Parameters
    ----------
    consist, instrument
        Drawing of the train, and the reflectometer.
    samples
        Samples of the whole trace.
    start_s
        Time of the first of them [s]; by default that of the instrument.
    """

    def __init__(
        self,
        consist: Consist,
        instrument: Reflectometer,
        samples: int,
        start_s: float | None = None,
    ) -> None:
        self.consist = consist
        self.instrument = instrument
        self.cars = len(consist.runs)
        self._samples = samples
        self._start_s = instrument.start_s if start_s is None else start_s
        delays = [run.length_m / run.cable.velocity_m_per_s for run in consist.runs]
        self._ends_s = 2 * np.cumsum(delays)
        self._models: dict[int, TraceModel] = {}
        self._metrics: dict[tuple[int, float], Metric] = {}

    def samples(self, runs: int) -> int:
        """Samples in which a wave reaches the end of a number of runs and returns."""
        if runs >= self.cars:
            return self._samples
        end = self._ends_s[runs - 1] + _BEYOND_RISES * self.instrument.rise_time_s
        count = (end - self._start_s) / self.instrument.sample_period_s
        return min(max(int(count), 16), self._samples)

    def model(self, runs: int) -> TraceModel:
        """Model of the window of a number of runs."""
        runs = min(runs, self.cars)
        if runs not in self._models:
            samples = self.samples(runs)
            reached = None if runs >= self.cars else runs + 1
            self._models[runs] = TraceModel(
                self.consist, self.instrument, samples, self._start_s, reached
            )
        return self._models[runs]

    def fit(
        self,
        trace: FloatArray,
        sigma: float,
        runs: int,
        deviations: FloatArray,
        fault: FaultGuess | None = None,
        steps: int = 6,
    ) -> Fit:
        """Fit of the window of a number of runs."""
        model = self.model(runs)
        return fit(model, trace, self.metric(runs, sigma, deviations), deviations, fault, steps)

    def metric(self, runs: int, sigma: float, deviations: FloatArray) -> Metric:
        """Metric of the window of a number of runs, for traces of a given noise.

        What the roughness scatters back comes when the delays of the train let it: the first
        deviations that are given for a window count, and stand until :meth:`forget`.
        """
        key = (min(runs, self.cars), sigma)
        if key not in self._metrics:
            self._metrics[key] = Metric(sigma, self.model(runs).backscatter(deviations))
        return self._metrics[key]

    def forget(self, runs: int) -> None:
        """Have the metrics of the window of a number of runs made anew when they are needed."""
        for key in [key for key in self._metrics if key[0] == min(runs, self.cars)]:
            del self._metrics[key]

    def strides(self, first: int = 0) -> list[int]:
        """Numbers of runs of growing windows, after `first`, up to all."""
        step, runs = [], first
        while runs < self.cars:
            runs = min(self.cars, max(runs + 1, int(runs * _STRIDE)))
            step.append(runs)
        return step

    def run_at(self, place_m: float) -> int:
        """Number of the run at a place."""
        starts = self.consist.starts_m
        return int(np.clip(np.searchsorted(starts, place_m, "right") - 1, 0, self.cars - 1))


@dataclass(frozen=True)
class SequentialFit:
    """How far a train without fault explains a trace.

    Parameters
    ----------
    healthy
        Last fit that was right.
    healthy_runs
        Runs of cable it covers; 0 if not even the first was.
    failed
        Fit of the first window that is wrong; None where all are right.
    failed_runs
        Runs of cable of that window.
    """

    healthy: Fit | None
    healthy_runs: int
    failed: Fit | None
    failed_runs: int


def fit_sequentially(windows: Windows, trace: FloatArray, sigma: float) -> SequentialFit:
    """Fit growing windows until one is wrong, and then run by run to the first that is."""
    deviations = first_guess(windows, trace, sigma)
    windows.forget(1)
    healthy: Fit | None = None
    done = 0
    for runs in windows.strides():
        step = _next(windows, trace, sigma, runs, healthy, deviations)
        if not _is_wrong(healthy, step):
            healthy, done = step, runs
            continue
        for single in range(done + 1, runs):
            closer = _next(windows, trace, sigma, single, healthy, deviations)
            if _is_wrong(healthy, closer):
                return SequentialFit(healthy, done, closer, single)
            healthy, done = closer, single
        step = _next(windows, trace, sigma, runs, healthy, deviations)
        return SequentialFit(healthy, done, step, runs)
    return SequentialFit(healthy, done, None, done)


def first_guess(windows: Windows, trace: FloatArray, sigma: float) -> FloatArray:
    """Deviations as drawn, but for the delay that brings the end of the first run into place.

    A few per cent of a long run are more than a rise time: too far for Gauss-Newton.
    """
    model = windows.model(1)
    drawn = np.zeros(COMMON + 4 * windows.cars - 1)
    at = windows.fit(trace, sigma, 1, drawn, steps=0)
    guesses = np.tile(drawn, (len(_BATCH_DELAYS), 1))
    guesses[:, 1] = _BATCH_DELAYS
    traces = np.stack([model.trace(guess) for guess in guesses])
    # The projection counts from the drawing; what a guess costs by itself comes on top.
    costs = Projection(at).costs((traces - at.prediction.trace) / sigma) + guesses[:, 1] ** 2
    return np.asarray(guesses[int(np.argmin(costs))])


def _next(
    windows: Windows,
    trace: FloatArray,
    sigma: float,
    runs: int,
    healthy: Fit | None,
    start: FloatArray,
) -> Fit:
    first = start if healthy is None else healthy.deviations
    return windows.fit(trace, sigma, runs, first, steps=4)


def _is_wrong(before: Fit | None, now: Fit) -> bool:
    """Whether what a window adds is more than noise and tolerances can be."""
    cost, samples = (0.0, 0) if before is None else (before.cost, before.samples)
    added = now.samples - samples
    limit = max(_EXCESS_SIGMAS * math.sqrt(2 * max(added, 1)), 0.0) + _EXCESS_LEAST
    return now.cost - cost - added > limit
