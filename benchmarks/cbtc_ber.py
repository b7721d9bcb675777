"""Information bits simulated per CPU-second: the fast link beside komm, pyphysim and NumPy.

Gray QPSK at 5 dB per receiver through Rayleigh fading with perfect channel knowledge, a new
channel for every code block of two symbols, generator included. All sides draw bits, channel
and noise, transmit, combine, decide and count, and the errors of each must agree with the
closed form. NumPy is `PlainLink`: the equations in complex128. The peers' passes and forms
are told in ``peers/``; they need not be installed and are looked for in the interpreter named
by RAIL_PEERS_PYTHON, then in this one.

The bound is the rate at which the deviates of a code block alone are drawn, by the same polynomials
in one compiled loop without transmission, combining or decision, fused multiply-adds allowed.

CPU time of all threads counts. Sides run in turns; the figure of each is the median of the
rounds, the best pass of a round counting.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numba
import numpy as np

from rail_signals.train_radio.ber.closed_form import SCHEMES, error_rate
from rail_signals.train_radio.ber.deviates import draw_words, normal_deviates, seeded_lanes
from rail_signals.train_radio.ber.link import LANES, DiversityLink
from rail_signals.train_radio.ber.monte_carlo import Link
from rail_signals.train_radio.ber.plain_link import PlainLink
from rail_signals.train_radio.space_time_block import Scheme

FOLDER = Path(__file__).parent / "peers"
PEERS = {"komm": "komm_ber.py", "pyphysim": "pyphysim_ber.py"}
#: Bits of a pass: some tenths of a second each.
BITS = {"ours": 48_000_000, "NumPy": 1_000_000, "komm": 1_000_000, "pyphysim": 50_000}
#: Code blocks of a step of ours, as many as make the highest rate.
CODE_BLOCKS = 32_768
EB_N0_DB = 5.0
ROUNDS = 7
PASSES = 3


@dataclass(frozen=True)
class Count:
    """Errors of one side in one round; `group` bits share a channel."""

    rate: float
    errors: int
    bits: int
    group: int
    squares: int = 0


def rows(names: tuple[str, ...] = ()) -> Iterator[dict[str, Any]]:
    """Measure, and yield one row per scheme; only those whose names begin as one of `names`."""
    pythons = {name: _python_with(name) for name in PEERS}
    for scheme in reversed(SCHEMES.values()):
        name = f"cbtc.ber_{scheme.name}_qpsk"
        if not names or any(name.startswith(wanted) for wanted in names):
            yield _row(name, scheme, pythons)


def _row(name: str, scheme: Scheme, pythons: dict[str, str | None]) -> dict[str, Any]:
    """Measure one row."""
    eb_n0 = 10 ** (EB_N0_DB / 10)
    fast = DiversityLink(scheme, eb_n0, code_blocks=CODE_BLOCKS)
    plain = PlainLink(scheme, eb_n0, code_blocks=2048)
    generators = np.random.SFC64(1), np.random.PCG64(2)
    counts: dict[str, list[Count]] = {"ours": [], "NumPy": []}
    fast.step(generators[0])  # compiles
    floor = Deviates(scheme)
    bounds: list[float] = []
    for turn in range(ROUNDS):  # in turns, so that all see the same machine
        counts["ours"].append(_run(fast, generators[0], BITS["ours"]))
        bounds.append(floor.rate(BITS["ours"]))
        counts["NumPy"].append(_run(plain, generators[1], BITS["NumPy"]))
        for peer, python in pythons.items():
            if python:
                counts.setdefault(peer, []).append(_run_peer(peer, python, scheme, turn))
    _check(counts, float(error_rate(scheme, eb_n0)))
    rates = {side: statistics.median(c.rate for c in runs) for side, runs in counts.items()}
    mine = rates.pop("ours")
    installed = {side: rate for side, rate in rates.items() if side in PEERS} or rates
    best = max(installed, key=lambda side: installed[side])
    others = [f"{side} {rate / 1e6:.2f}" for side, rate in rates.items() if side != best]
    others += [f"{side} not installed" for side, python in pythons.items() if not python]
    return {
        "name": name,
        "unit": "Mbit/CPU-s",
        "ours": mine / 1e6,
        "peer_name": f"{best} ({', '.join(others)})",
        "peer": rates[best] / 1e6,
        "ratio": mine / rates[best],
        "bound": statistics.median(bounds) / 1e6,
    }


class Deviates:
    """Draws of code blocks, and nothing else."""

    def __init__(self, scheme: Scheme) -> None:
        fused = numba.njit(nogil=True, fastmath=True)
        words, deviates = fused(draw_words.py_func), fused(normal_deviates.py_func)

        def draw(count, states, word, power, u, u_bits, m, m_bits, out):  # type: ignore[no-untyped-def]
            for _ in range(count):
                words(states, word)
                deviates(word, power, u, u_bits, m, m_bits, out)

        self._draw = fused(draw)
        self._per_block = scheme.transmit * scheme.receive + 2 * scheme.receive
        u, m = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
        self._arguments = (
            seeded_lanes(np.random.SFC64(3), LANES),
            np.empty(LANES, np.uint32),
            np.float32(-1.0),
            *(u, u.view(np.int32), m, m.view(np.int32)),
            np.empty((2, LANES), np.float32),
        )
        self._draw(1, *self._arguments)

    def rate(self, bits: int) -> float:
        """Bits of QPSK per CPU-second for which it draws, best of the passes."""
        count = bits // (4 * LANES) * self._per_block
        cpu_s = []
        for _ in range(PASSES):
            start = time.process_time()
            self._draw(count, *self._arguments)
            cpu_s.append(time.process_time() - start)
        return bits // (4 * LANES) * (4 * LANES) / min(cpu_s)


def _run(link: Link, generator: np.random.BitGenerator, bits: int) -> Count:
    """Bits per CPU-second, best of the passes."""
    steps = bits // link.bits_per_step
    errors, squares, cpu_s = 0, 0, []
    for _ in range(PASSES):
        start = time.process_time()
        for _ in range(steps):
            more, more_squares = link.step(generator)
            errors += more
            squares += more_squares
        cpu_s.append(time.process_time() - start)
    done = steps * link.bits_per_step
    return Count(done / min(cpu_s), errors, PASSES * done, 2 * link.bits_per_symbol, squares)


def _run_peer(peer: str, python: str, scheme: Scheme, seed: int) -> Count:
    """Run a child, and return what it counted."""
    numbers = (scheme.name, EB_N0_DB, BITS[peer], PASSES, seed)
    done = subprocess.run(
        [python, str(FOLDER / PEERS[peer]), *map(str, numbers)],
        capture_output=True,
        text=True,
        check=True,
    )
    answer = json.loads(done.stdout)
    rate = answer["bits"] / min(answer["cpu_s"])
    return Count(rate, answer["errors"], PASSES * answer["bits"], answer["group_bits"])


def _check(counts: dict[str, list[Count]], expected: float) -> None:
    """Refuse to report the speed of a wrong result.

    Bits that share a channel fail together: the correlation of their errors, the same for all
    sides, comes from our own counts.
    """
    ours = counts["ours"]
    bits, group = sum(c.bits for c in ours), ours[0].group
    pairs = sum(c.squares - c.errors for c in ours) / (bits * (group - 1))
    correlation = (pairs - expected**2) / (expected * (1 - expected))
    for side, runs in counts.items():
        bits, errors = sum(c.bits for c in runs), sum(c.errors for c in runs)
        clumping = 1 + (runs[0].group - 1) * max(correlation, 0.0)
        sigma = math.sqrt(expected * (1 - expected) * bits * clumping)
        if abs(errors - expected * bits) > 5 * sigma:
            raise RuntimeError(f"{side}: error rate {errors / bits:.3e}, not {expected:.3e}")


def _python_with(package: str) -> str | None:
    """Find an interpreter that has the package; None where there is none."""
    for candidate in (os.environ.get("RAIL_PEERS_PYTHON"), sys.executable):
        if candidate and Path(candidate).exists():
            probe = [candidate, "-c", f"import {package}"]
            if subprocess.run(probe, capture_output=True, check=False).returncode == 0:
                return candidate
    return None


def main() -> None:
    """Print the rows."""
    for row in rows(tuple(sys.argv[1:])):
        print(
            f"{row['name']:28} {row['ours']:7.2f} {row['unit']}"
            f"  {row['peer_name']}: {row['peer']:.2f}  ratio {row['ratio']:.2f} x"
            f"  bound {row['bound']:.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
