"""Where to look for a fault: what a train without one leaves of a trace, and the scan of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray

from .backscatter import resolution_m
from .fault_scan import FaultScan, scan_faults
from .fields import Fields
from .fit import Fit
from .model import TraceModel
from .projection import Projection
from .sequential_fit import SequentialFit, Windows

AHEAD_M = 18.0
"""What lies so far ahead of an excess of chi-square may have caused it [m]."""

_APART_M = 5.0


@dataclass(frozen=True)
class ResidualScan:
    """Where to look for a fault, and what a train without one leaves there.

    Parameters
    ----------
    runs
        Runs of cable of the window.
    last_m
        Where the last run that a healthy train explains ends, less what the line blurs there
        [m]; 0 if it explains all or nothing.
    model, base, fields, projection
        Model of the window, fit without fault, and what follows of it.
    fault_scan
        The scan of the stretch.
    is_started
        Whether a first run without fault has told what the batch is like.
    is_explained
        Whether a healthy train explains all but what the scan found.
    """

    runs: int
    last_m: float
    model: TraceModel
    base: Fit
    fields: Fields
    projection: Projection
    fault_scan: FaultScan
    is_started: bool
    is_explained: bool


def scan_residual(
    windows: Windows,
    trace: FloatArray,
    sigma: float,
    sequential: SequentialFit,
    about: FloatArray | None = None,
) -> ResidualScan:
    """Scan what a walk has left unexplained.

    A window that does not fit tells of a fault before its end.

    Parameters
    ----------
    windows, trace, sigma, sequential
        The trace, its noise, and how far it was explained.
    about
        Deviations to scan at where the walk knows none; by default those of the drawing.
    """
    starts, cars = windows.consist.starts_m, windows.cars
    last_m = 0.0
    if sequential.failed is None:
        assert sequential.healthy is not None
        runs, high, base = cars, float(starts[-1]), sequential.healthy
    else:
        last = sequential.failed_runs
        # Of the first run the batch is not known yet: what follows tells it from a fault.
        runs = min(cars, last + (2 if last == 1 else 1))
        high = float(starts[last]) + _APART_M
        known = sequential.healthy
        end = float(starts[sequential.healthy_runs])
        last_m = max(0.0, end - AHEAD_M - blur_m(windows, end))
        start = np.zeros_like(sequential.failed.deviations) if about is None else about
        start = start if known is None else known.deviations
        base = windows.fit(trace, sigma, runs, start, steps=0)
    model = windows.model(runs)
    fields = model.fields(base.deviations)
    projection = Projection(base)
    scanned = scan_faults(model, base, fields, projection, high)
    return ResidualScan(
        runs,
        last_m,
        model,
        base,
        fields,
        projection,
        scanned,
        sequential.healthy is not None or about is not None,
        sequential.failed is None,
    )


def blur_m(windows: Windows, place_m: float) -> float:
    """Length of cable that an edge covers while it rises, at a place of a train [m]."""
    cable = windows.consist.runs[0].cable
    return resolution_m(cable, place_m, windows.instrument.rise_time_s)
