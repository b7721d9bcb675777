"""Bursts received per CPU-second: the line receiver beside GNU Radio's discriminator.

Bursts of 0.992 ms at 4 MS/s (3968 samples, whole periods of the 375 kHz tone), one tone
of index 1 at 20 dB of carrier-to-noise ratio per sample. Receive only: both sides start
from the same single-precision samples in memory and end with a phase for each burst,
checked against the truth. The line receiver also searches carrier offsets up to 1 kHz
(300 km/h and 0.1 ppm at 2.6 GHz make 983 Hz) or 5 kHz, and estimates noise, misfit and
detection. CPU time of one process is counted; matrix products use one thread. Each round
takes the best of a few passes on either side, the figure is the median of the rounds.

The bound of a batch is what reading the samples once and summing their squares takes, in the same
rounds; that of a single burst is the same receiver with many bursts of that length at once, where
no call but the compiled arithmetic is left.
"""

from __future__ import annotations

import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from rail_signals.ranging.bounds import tone_phase_variance_bound
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate

PEER = Path(__file__).parent / "peers" / "gnuradio_ranging.py"
SNR = 100.0
BURSTS = 512
ROUNDS = 7
PASSES = 5


def rows() -> list[dict[str, Any]]:
    """Measure, and return one row per figure."""
    rng = np.random.default_rng(7)
    signal = RangingSignal(samples=3968)
    lag, bursts = _bursts(rng, signal, BURSTS)
    bound_rad = math.sqrt(float(tone_phase_variance_bound(SNR, signal.samples, 1.0)))
    python = _peer_python()
    usual = FmToneReceiver(signal, max_offset_hz=1e3)
    wide = FmToneReceiver(signal, max_offset_hz=5e3)
    double = bursts.astype(np.complex128)
    cases = (
        ("ranging.receive", usual, bursts),
        ("ranging.receive_double", usual, double),
        ("ranging.receive_5khz", wide, bursts),
    )
    ours: dict[str, list[float]] = {name: [] for name, _, _ in cases}
    bounds: dict[str, list[float]] = {name: [] for name, _, _ in cases}
    peer: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bursts.npy"
        np.save(path, bursts)
        for _ in range(ROUNDS):  # in turns, so that both see the same machine
            for name, receiver, block in cases:
                rate, found = _rate(receiver, block)
                _check(found - lag, 6 * bound_rad, "line receiver")
                ours[name].append(rate)
                bounds[name].append(_reading_rate(block))
            if python:
                rate, found = _peer_rate(python, path, signal)
                _check((found - lag)[1:], 6 * bound_rad + 0.01, "GNU Radio")
                peer.append(rate)
    peer_rate = statistics.median(peer) if peer else None
    peer_name = "GNU Radio" if peer else "GNU Radio (not installed)"

    def row(
        name: str, rate: float, against: float | None, label: str, bound: float
    ) -> dict[str, Any]:
        return {
            "name": name,
            "unit": "bursts/CPU-s",
            "ours": rate,
            "peer_name": label,
            "peer": against,
            "ratio": rate / against if against else None,
            "bound": bound,
        }

    single, arithmetic = _single_rates(rng)
    return [
        *(
            row(
                name,
                statistics.median(rates),
                peer_rate,
                peer_name,
                statistics.median(bounds[name]),
            )
            for name, rates in ours.items()
        ),
        row("ranging.receive_single_960", single, None, "none", arithmetic),
    ]


def _bursts(
    rng: np.random.Generator, signal: RangingSignal, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Draw true lags [count] and noisy bursts [count, samples] in single precision."""
    lag = rng.uniform(0, 2 * math.pi, (count, 1))
    bursts = modulate(signal, lag)
    shape = (*bursts.shape, 2)
    bursts += rng.normal(scale=math.sqrt(0.5 / SNR), size=shape).view(np.complex128)[..., 0]
    return lag[:, 0], bursts.astype(np.complex64)


def _rate(receiver: FmToneReceiver, bursts: np.ndarray) -> tuple[float, np.ndarray]:
    """Bursts per CPU-second, best of the passes, and the lags found."""
    cpu_s = []
    for _ in range(PASSES):
        start = time.process_time()
        found = receiver.estimate(bursts)
        cpu_s.append(time.process_time() - start)
    if not found.detected.all():
        raise RuntimeError("the line receiver missed a burst")
    return len(bursts) / min(cpu_s), found.phase_lag_rad[:, 0]


def _reading_rate(bursts: np.ndarray) -> float:
    """Bursts per CPU-second whose samples are read and squared, best of the passes."""
    parts = bursts.view(bursts.real.dtype)
    cpu_s = []
    for _ in range(PASSES):
        start = time.process_time()
        np.vecdot(parts, parts)
        cpu_s.append(time.process_time() - start)
    return len(bursts) / min(cpu_s)


def _single_rates(rng: np.random.Generator) -> tuple[float, float]:
    """Bursts of 960 samples per CPU-second: in single calls, as a station makes, and in one."""
    signal = RangingSignal()
    receiver = FmToneReceiver(signal)
    burst = _bursts(rng, signal, 1)[1][0].astype(np.complex128)
    many = np.tile(burst, (40, 1))
    rates, arithmetic = [], []
    for _ in range(ROUNDS):
        start = time.process_time()
        for _ in range(1000):
            receiver.estimate(burst)
        rates.append(1000 / (time.process_time() - start))
        start = time.process_time()
        for _ in range(50):
            receiver.estimate(many)
        arithmetic.append(50 * len(many) / (time.process_time() - start))
    return statistics.median(rates), statistics.median(arithmetic)


def _peer_python() -> str | None:
    """Find an interpreter that has GNU Radio; None where there is none."""
    for candidate in (sys.executable, "/usr/bin/python3", shutil.which("python3")):
        if candidate and Path(candidate).exists():
            probe = [candidate, "-c", "import gnuradio.analog, gnuradio.filter"]
            if subprocess.run(probe, capture_output=True, check=False).returncode == 0:
                return candidate
    return None


def _peer_rate(python: str, path: Path, signal: RangingSignal) -> tuple[float, np.ndarray]:
    """Bursts per CPU-second of GNU Radio, best of the passes, and its lags."""
    numbers = (signal.cycles_per_period[0], signal.period_samples, PASSES)
    arguments = [str(path), *map(str, numbers)]
    done = subprocess.run(
        [python, str(PEER), *arguments], capture_output=True, text=True, check=True
    )
    answer = json.loads(done.stdout)
    lag = np.array(answer["phase_lag_rad"], dtype=np.float64)
    return len(lag) / min(answer["cpu_s"]), lag


def _check(error_rad: np.ndarray, limit_rad: float, who: str) -> None:
    """Refuse to report the speed of a wrong result."""
    worst = float(np.abs(np.angle(np.exp(1j * error_rad))).max())
    if not worst < limit_rad:
        raise RuntimeError(f"{who}: phase error {worst:.2g} rad, more than {limit_rad:.2g}")


def main() -> None:
    """Print the rows."""
    for row in rows():
        peer = f"{row['peer']:.0f}" if row["peer"] else "-"
        ratio = f"{row['ratio']:.2f} x" if row["ratio"] else "-"
        print(
            f"{row['name']:28} {row['ours']:10.0f} {row['unit']}"
            f"  {row['peer_name']}: {peer}  ratio {ratio}  bound {row['bound']:.0f}"
        )


if __name__ == "__main__":
    main()
