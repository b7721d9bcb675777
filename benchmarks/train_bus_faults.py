"""One fault anywhere in a whole train: whether it is found, where, and as what.

    python benchmarks/train_bus_faults.py [--cases N] [--healthy N] [--snr DB] [--seed N]
                                          [--curve [--figure FILE]] [--json FILE]

Random trains of `rail_signals.train_bus.study.campaign`, N of each of the seven kinds of fault and
N healthy
ones, four traces each, at a signal-to-noise ratio of DB for one trace. Printed are, each with a
95 % Clopper-Pearson interval: faults found, located within 0.5 m or 1 % of the length of the bus
(whichever is larger), and named rightly, as shares of all faults; which kind is taken for which;
healthy trains flagged; and the CPU time of an interpretation.

`--curve` adds the limits of detection: for four measures of a fault the size that is found in
half and in nine of ten places, by theory over random trains and places, at several ratios of
signal to noise; and next to it how many of that size an interpretation really found.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from scipy import stats

from rail_signals.train_bus.consist import COMMON
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.study.campaign import (
    HEALTHY,
    TRACES,
    Case,
    CaseResult,
    draw_case,
    examine,
)
from rail_signals.train_bus.study.detection_limits import detectable_size, fault_of_size

CURVE_SNR_DB = (40.0, 50.0, 60.0, 70.0)
CURVE_KINDS = {
    "bad_splice": ("resistance in series", "ohm"),
    "loose_connector": ("steady resistance of a coupler", "ohm"),
    "water_ingress": ("capacitance of 5 m up", "%"),
    "wrong_cable": ("impedance of a run off", "%"),
}
CURVE_TRAINS = 24
CURVE_CHECKS = 12


def main() -> None:
    """Run the campaign."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=300, help="trains of each kind of fault")
    parser.add_argument("--healthy", type=int, default=2000, help="trains without fault")
    parser.add_argument("--snr", type=float, default=60.0, help="signal to noise [dB]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--curve", action="store_true", help="limits of detection as well")
    parser.add_argument("--figure", type=Path, help="picture of these limits: .png, .svg, .pdf")
    parser.add_argument("--json", type=Path, help="write the figures to a file")
    options = parser.parse_args()
    report: dict[str, Any] = {"snr_db": options.snr, "seed": options.seed, "traces": TRACES}
    report |= campaign(options.cases, options.healthy, options.snr, options.seed)
    if options.curve:
        report["curve"] = curve(options.seed)
        if options.figure:
            draw_curve(report["curve"], options.figure)
    if options.json:
        options.json.write_text(json.dumps(report, indent=2) + "\n")


def campaign(cases: int, healthy: int, snr_db: float, seed: int) -> dict[str, Any]:
    """Print and return the tables."""
    wanted = {kind: healthy if kind == HEALTHY else cases for kind in (*KINDS, HEALTHY)}
    counts: dict[str, dict[str, int]] = {kind: {} for kind in wanted}
    seconds: dict[str, list[float]] = {kind: [] for kind in wanted}
    rows = {kind: np.zeros(4, dtype=np.int64) for kind in wanted}
    print(f"signal to noise {snr_db:g} dB in one trace, {TRACES} traces", flush=True)
    # All kinds in turns: what is done when it is interrupted is a campaign as well.
    turns = [((k + 0.5) / n, kind, k) for kind, n in wanted.items() for k in range(n)]
    try:
        for _, kind, k in sorted(turns, key=lambda turn: turn[0]):
            case, outcome, spent = run_case(kind, [seed, list(wanted).index(kind), k], snr_db)
            found = outcome.reported != HEALTHY
            rows[kind] += [1, found, outcome.is_located, outcome.reported == kind]
            counts[kind][outcome.reported] = counts[kind].get(outcome.reported, 0) + 1
            seconds[kind].append(spent)
            if outcome.reported != kind or not (outcome.is_located or kind == HEALTHY):
                _tell(k, case, outcome)
    except KeyboardInterrupt:
        print("interrupted", flush=True)
    _print_rows(rows, seconds)
    totals = sum(rows[kind] for kind in KINDS)
    healthy = int(rows[HEALTHY][0])
    shares_of_all = {
        name: _share(int(n), int(totals[0]))
        for name, n in zip(("found", "located", "named"), totals[1:], strict=True)
    }
    flagged = healthy - counts[HEALTHY].get(HEALTHY, 0)
    shares_of_all["healthy_flagged"] = _share(flagged, healthy)
    for name, (share, low, high) in shares_of_all.items():
        print(f"{name:16} {100 * share:6.2f} % (95 %: {100 * low:.2f} to {100 * high:.2f})")
    _print_confusion(counts)
    return {
        "shares": shares_of_all,
        "confusion": counts,
        "cpu_ms": {kind: 1e3 * float(np.mean(times)) for kind, times in seconds.items() if times},
    }


def _print_rows(rows: dict[str, Any], seconds: dict[str, list[float]]) -> None:
    print(f"{'kind':22} {'cases':>6} {'found':>7} {'located':>8} {'named':>7} {'ms':>6} {'p95':>6}")
    for kind, row in rows.items():
        times = 1e3 * np.array(seconds[kind] or [math.nan])
        shares = [f"{100 * n / max(row[0], 1):.2f}" for n in row[1:]]
        if kind == HEALTHY:
            shares[1:] = ["", ""]
        print(
            f"{kind:22} {row[0]:6} {shares[0]:>7} {shares[1]:>8} {shares[2]:>7}"
            f" {times.mean():6.0f} {np.percentile(times, 95):6.0f}"
        )


def run_case(kind: str, seed: list[int], snr_db: float) -> tuple[Case, CaseResult, float]:
    """Draw, measure and interpret one case; returns it with the CPU seconds of all that."""
    rng = np.random.default_rng(seed)
    case = draw_case(kind, rng, snr_db)
    start = time.process_time()
    outcome = examine(case, rng)
    return case, outcome, time.process_time() - start


def curve(seed: int) -> list[dict[str, Any]]:
    """Print and return the limits of detection."""
    rows = []
    print("\nsize that is found in 50 % and 90 % of random trains and places")
    print(f"{'fault':34} {'dB':>4} {'50 %':>8} {'90 %':>8}   found at the latter")
    for number, (kind, (what, unit)) in enumerate(CURVE_KINDS.items()):
        scale = 100 if unit == "%" else 1
        for snr_db in CURVE_SNR_DB:
            sizes = []
            for k in range(CURVE_TRAINS):
                rng = np.random.default_rng([seed, 100 + number, k])
                case = draw_case(kind, rng, snr_db)
                sizes.append(detectable_size(case, rng, 0.5))
            half, most = np.quantile(sizes, [0.5, 0.9])
            found = 0
            for k in range(CURVE_CHECKS):
                rng = np.random.default_rng([seed, 200 + number, k])
                case = draw_case(kind, rng, snr_db)
                case = replace(case, fault=fault_of_size(case, float(most), rng))
                found += examine(case, rng).reported != HEALTHY
            share = found / CURVE_CHECKS
            rows.append(
                {"kind": kind, "what": what, "unit": unit, "snr_db": snr_db}
                | {"half": scale * half, "most": scale * most, "found_at_most": share}
            )
            print(
                f"{what + ' [' + unit + ']':34} {snr_db:4.0f} {scale * half:8.3g}"
                f" {scale * most:8.3g}   {100 * share:.0f} % of {CURVE_CHECKS}",
                flush=True,
            )
    return rows


def draw_curve(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the limits of detection: size over signal-to-noise ratio, one panel for each kind."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 5.5), layout="constrained")
    for axes, kind in zip(figure.subplots(2, 2, sharex=True).flat, CURVE_KINDS, strict=True):
        own = [row for row in rows if row["kind"] == kind]
        snr = [row["snr_db"] for row in own]
        axes.semilogy(snr, [row["most"] for row in own], "o-", label="in 90 % of places")
        axes.semilogy(snr, [row["half"] for row in own], "s--", label="in 50 % of places")
        axes.set_title(f"{kind.replace('_', ' ')}: {own[0]['what']} [{own[0]['unit']}]", size=10)
        axes.grid(alpha=0.3, which="both")
    figure.supxlabel("signal to noise in one trace [dB], four traces")
    figure.supylabel("smallest size that is found")
    figure.axes[0].legend()
    figure.savefig(path)


def _share(count: int, total: int) -> tuple[float, float, float]:
    """Share and its 95 % Clopper-Pearson interval."""
    if not total:
        return math.nan, 0.0, 1.0
    low = stats.beta.ppf(0.025, count, total - count + 1) if count else 0.0
    high = stats.beta.ppf(0.975, count + 1, total - count) if count < total else 1.0
    return count / total, float(low), float(high)


def _print_confusion(counts: dict[str, dict[str, int]]) -> None:
    names = [*KINDS, HEALTHY]
    print("\ntaken for" + " " * 14 + " ".join(f"{name[:8]:>8}" for name in names))
    for kind in names:
        cells = " ".join(f"{counts[kind].get(name, 0) or '.':>8}" for name in names)
        print(f"{kind:22} {cells}")


def _tell(number: int, case: Case, outcome: CaseResult) -> None:
    """One line about a case that went wrong."""
    finding = outcome.interpretation.finding
    what = "nothing" if finding is None else f"{finding.kind} at {finding.place_m:.1f} m"
    cars = (len(case.deviations.to_vector()) - COMMON + 1) // 4
    print(
        f"  {case.kind} {number}: {cars} cars, {case.consist.length_m:.0f} m, {what}: {case.fault}",
        flush=True,
    )


if __name__ == "__main__":
    main()
