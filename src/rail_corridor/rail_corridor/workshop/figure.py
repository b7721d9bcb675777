"""The figure of ``rail tdr``: the trace, what explains it, where the cars and the fault are."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from rail_corridor.plotting import COLOURS, STYLE
from rail_signals.train_bus.fault_words import fault_words, size_of
from rail_signals.train_bus.tdr.traces import summarise

from .workshop import Diagnosis


def draw_diagnosis(diagnosis: Diagnosis, path: Path) -> None:
    """Draw a diagnosis into a file; its ending says in which format."""
    with mpl.rc_context(STYLE):
        figure = Figure()
        _draw(figure, diagnosis)
        metadata = {"Software": None} if path.suffix.lower() == ".png" else None
        figure.savefig(path, metadata=metadata)


def _draw(figure: Figure, diagnosis: Diagnosis) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    traces, fit = diagnosis.reflectogram, diagnosis.reading.fit
    consist = diagnosis.consist
    line = consist.bus_line(diagnosis.reading.deviations)
    # Half the way of a wave, at the mean speed of this line.
    metres = traces.time_s * (line.length_m / line.delay_s) / 2.0
    summary = summarise(traces)
    # Where a contact is loose no two traces agree: one of them was explained.
    trace = summary.mean if summary.change is None else summary.highest
    for row in traces.reflection if summary.change is not None else ():
        upper.plot(metres, row, color=COLOURS[0], linewidth=0.6, alpha=0.4)
    upper.plot(metres, trace, label="measured", color=COLOURS[0])
    model = fit.prediction.trace
    upper.plot(
        metres[: len(model)], model, "--", label="explained", color=COLOURS[1], linewidth=1.2
    )
    starts_m = consist.starts_m
    for place_m in starts_m:
        upper.axvline(place_m, color="0.7", linewidth=0.8, zorder=0)
    top = upper.get_ylim()[1]
    for number, middle_m in enumerate(0.5 * (starts_m[1:] + starts_m[:-1]), start=1):
        upper.text(middle_m, top, f"car {number}", ha="center", va="bottom", color="0.4")
    finding = diagnosis.reading.finding
    if finding is not None:
        words = fault_words(finding.kind, finding.car, finding.place_m, size_of(finding))
        upper.axvline(finding.place_m, color=COLOURS[3], label=words)
    upper.set_ylabel("reflection")
    upper.legend(loc="best")
    left = trace[: len(model)] - model
    lower.plot(metres[: len(model)], 1e3 * left, color=COLOURS[2], linewidth=0.8)
    lower.set_ylabel("left, 1e-3")
    lower.set_xlabel("distance along the cable [m]")
    lower.set_xlim(float(metres[0]), min(float(metres[-1]), 1.3 * float(np.max(starts_m))))
