"""A trace of a line, beside scikit-rf in its leanest form and in its idiom.

    python benchmarks/train_bus_traces.py

Twenty mismatched sections of lossy cable with skin effect and a mismatched load: the reflection
of the head at 4097 frequencies from 0 to 204.8 MHz, its impulse response and its step response.
All sides get the same constants of the cable, compute everything else in every pass, and must
agree to 1e-9.

- ours: `input_reflection`, one inverse transform, one sum;
- scikit-rf, leanest: the ABCD matrices of all sections by NumPy, multiplied entry by entry, one
  network made from the product, ended by a load, `impulse_response` and `step_response`;
- scikit-rf, idiom: a `DefinedGammaZ0` medium of each section, `line`, and ``**``.

The bound is the arithmetic without what leads to it: one compiled pass over the sections, whose
constants are known, one inverse transform, one sum.

CPU time of all threads. Sides run in turns; the figure of each is the median of the rounds, the
best pass of a round counting.
"""

from __future__ import annotations

import json
import os
import statistics
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from numpy.typing import NDArray

from rail_signals.train_bus.bus_line import BusLine, CableSection, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import input_reflection
from rail_signals.train_bus.section_kernel import through_sections

Trace = tuple[NDArray[Any], NDArray[Any], NDArray[Any]]

SECTIONS = 20
FREQUENCY_HZ = 5e4 * np.arange(4097)
SAMPLES = 2 * (len(FREQUENCY_HZ) - 1)
REFERENCE_OHM = 120.0
CABLE = Cable(0.936e-6, 65e-12, 0.05, 1e-9, 3e-4)
AGREE = 1e-9
ROUNDS = 9
PASSES = {"ours": 20, "bound": 20, "ABCD": 5, "idiom": 1}


def the_line() -> BusLine:
    """Sections that all reflect, by a few per cent each."""
    rng = np.random.default_rng(1)
    factors, lengths = rng.uniform(0.85, 1.15, SECTIONS), rng.uniform(10.0, 50.0, SECTIONS)
    parts = tuple(
        CableSection(CABLE, float(length), float(factor))
        for length, factor in zip(lengths, factors, strict=True)
    )
    return BusLine(parts, Termination(100.0))


def ours(bus_line: BusLine) -> Trace:
    """The project's own way."""
    reflection = input_reflection(bus_line, FREQUENCY_HZ, REFERENCE_OHM)
    impulse = np.fft.fftshift(np.fft.irfft(reflection, SAMPLES))
    step = np.cumsum(impulse)
    step -= impulse / 2  # by trapezia from the first sample, as scikit-rf has it
    step -= impulse[0] / 2
    return reflection, impulse, step


def bound() -> Callable[[BusLine], Trace]:
    """Pass over the sections, transform and sum alone; what they give is not a trace."""
    wave = CABLE.wave_constants(2j * np.pi * FREQUENCY_HZ)
    voltage, drop = np.ones((2, 2 * len(FREQUENCY_HZ)))

    def alone(bus_line: BusLine) -> Trace:
        lengths = np.full(len(bus_line.elements), 30.0)
        through_sections(
            voltage, drop, wave.attenuation, wave.phase, lengths, np.ones_like(lengths)
        )
        reflection = voltage.view(np.complex128)
        impulse = np.fft.irfft(reflection, SAMPLES)
        return reflection, impulse, np.cumsum(impulse)

    return alone


def scikit_rf() -> dict[str, Callable[[BusLine], Trace]] | None:
    """The ways of scikit-rf; None if it is not installed."""
    try:
        import skrf as rf
        from skrf.media import DefinedGammaZ0
    except ImportError:
        return None
    axis = rf.Frequency.from_f(FREQUENCY_HZ, unit="hz")

    def whole(chain: Any, load_ohm: float) -> Trace:
        rho = (load_ohm - REFERENCE_OHM) / (load_ohm + REFERENCE_OHM)
        end = rf.Network(
            frequency=axis, s=np.full((len(FREQUENCY_HZ), 1, 1), rho + 0j), z0=REFERENCE_OHM
        )
        seen = chain**end
        impulse = seen.impulse_response(window=None, n=SAMPLES)[1]
        step = seen.step_response(window=None, n=SAMPLES)[1]
        return seen.s[:, 0, 0], impulse, step

    def constants() -> tuple[NDArray[Any], NDArray[Any]]:
        wave = CABLE.wave_constants(2j * np.pi * FREQUENCY_HZ)
        return wave.propagation, wave.impedance

    def from_abcd(bus_line: BusLine) -> Trace:
        gamma, impedance = constants()
        sections: list[Any] = list(bus_line.elements)
        phase = gamma * np.array([s.length_m for s in sections])[:, None]
        z0 = impedance * np.array([s.impedance_factor for s in sections])[:, None]
        grown = np.exp(phase)
        fallen = 1 / grown
        cosh, sinh = (grown + fallen) / 2, (grown - fallen) / 2
        series, shunt = z0 * sinh, sinh / z0
        a, b, c, d = cosh[0], series[0], shunt[0], cosh[0]
        # Written out: batches of small matrices take NumPy's `@` ten times as long.
        for diagonal, upper, lower in zip(cosh[1:], series[1:], shunt[1:], strict=True):
            a, b = a * diagonal + b * lower, a * upper + b * diagonal
            c, d = c * diagonal + d * lower, c * upper + d * diagonal
        product = np.stack([a, b, c, d], axis=-1).reshape(-1, 2, 2)
        chain = rf.Network(frequency=axis, a=product, z0=REFERENCE_OHM)
        return whole(chain, bus_line.termination.resistance_ohm)

    def idiom(bus_line: BusLine) -> Trace:
        gamma, impedance = constants()
        chain = None
        for section in bus_line.elements:
            assert isinstance(section, CableSection)
            medium = DefinedGammaZ0(axis, gamma=gamma, z0=impedance * section.impedance_factor)
            part = medium.line(section.length_m, "m")
            part.renormalize(REFERENCE_OHM)
            chain = part if chain is None else chain**part
        return whole(chain, bus_line.termination.resistance_ohm)

    return {"ABCD": from_abcd, "idiom": idiom}


def measure() -> dict[str, float]:
    """Milliseconds of CPU time of each side."""
    bus_line = the_line()
    sides: dict[str, Callable[[BusLine], Trace]] = {"ours": ours, **(scikit_rf() or {})}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mine = ours(bus_line)
        for name, side in sides.items():
            check(name, mine, side(bus_line))
        sides["bound"] = bound()
        spent: dict[str, list[float]] = {name: [] for name in sides}
        for _ in range(ROUNDS):  # in turns, so that all see the same machine
            for name, side in sides.items():
                spent[name].append(min(_once(side, bus_line) for _ in range(PASSES[name])))
    return {name: 1e3 * statistics.median(times) for name, times in spent.items()}


def check(name: str, mine: Trace, theirs: Trace) -> None:
    """Stop unless reflection, impulse and step response agree."""
    for what, a, b in zip(("reflection", "impulse", "step"), mine, theirs, strict=True):
        off = float(np.abs(a - b).max()) if len(a) == len(b) else np.inf
        if not off < AGREE:
            raise SystemExit(f"{name}: {what} differs by {off:g}")


def rows() -> Iterator[dict[str, Any]]:
    """Yield the row of ``rail bench``."""
    found = measure()
    peer = found.get("ABCD")
    told = f"scikit-rf from ABCD (idiom {found['idiom']:.0f})" if peer else "scikit-rf missing"
    yield {
        "name": "train_bus.trace",
        "unit": "traces/CPU-s",
        "ours": 1e3 / found["ours"],
        "peer_name": told,
        "peer": None if peer is None else 1e3 / peer,
        "ratio": None if peer is None else peer / found["ours"],
        "bound": 1e3 / found["bound"],
    }


def _once(side: Callable[[BusLine], Trace], bus_line: BusLine) -> float:
    start = time.process_time()
    side(bus_line)
    return time.process_time() - start


def main() -> None:
    """Print the table."""
    found = measure()
    print(f"{SECTIONS} sections, {len(FREQUENCY_HZ)} frequencies, impulse and step response")
    print(f"{'':28} {'CPU ms':>8} {'times ours':>10}")
    names = {
        "ours": "ours",
        "bound": "bound",
        "ABCD": "scikit-rf, from ABCD",
        "idiom": "scikit-rf, idiom",
    }
    for name, told in names.items():
        if name in found:
            print(f"{told:28} {found[name]:8.2f} {found[name] / found['ours']:10.1f}")
        else:
            print(f"{told:28} not installed")
    print(json.dumps(found))


if __name__ == "__main__":
    main()
