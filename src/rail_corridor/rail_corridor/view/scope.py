"""A waveform block as a scope shows it: over time, as a spectrum, and in the I/Q plane.

Pure: arrays in, lists of rounded numbers out, few enough to be sent several times a second.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.equipment.live import SymbolReader
from rail_msgs_py.waveform import Waveform

POINTS = 480
BINS = 400
DOTS = 400
ZOOMS = (1, 4, 16, 64)
_FLOOR_DB = -220.0


def scope(
    block: Waveform, antenna: int = 0, zoom: int = 1, readers: Iterable[SymbolReader] = ()
) -> dict[str, Any]:
    """What the scope draws of one block.

    Parameters
    ----------
    block : Waveform
    antenna : int
        Counted from 0; taken as the last one there is where it is more.
    zoom : int
        Which part of the block is drawn over time: 1 of so many, from where the signal begins.
    readers : iterable of SymbolReader
        Asked in turn for the symbols of bursts, where the block holds any.
    """
    antennas, count = block.samples.shape
    antenna = min(max(antenna, 0), antennas - 1)
    samples = block.samples[antenna]
    shown: dict[str, Any] = {
        "stamp_s": round(block.stamp_ns * 1e-9, 3),
        "rate_hz": block.sample_rate_hz,
        "carrier_hz": block.carrier_hz,
        "channel": block.channel,
        "antennas": antennas,
        "antenna": antenna,
        "samples": count,
        "power_dbm": _finite(block.power_dbm),
        "radio": block.channel > 0,
        "silent": block.silent or not np.isfinite(block.power_dbm),
    }
    if shown["silent"]:
        return shown
    real = not np.any(samples.imag)
    shown["real"] = bool(real)
    shown["time"] = over_time(samples, block.sample_rate_hz, zoom, real=real)
    shown["spectrum"] = spectrum(samples, block.sample_rate_hz, real=real)
    found = (reader.symbols(block, antenna) for reader in readers)
    symbols = next((each for each in found if each is not None), None)
    shown["plane"] = plane(samples) if symbols is None else symbols
    return shown


def over_time(
    samples: NDArray[np.complex128], rate_hz: float, zoom: int, *, real: bool
) -> dict[str, Any]:
    """I and Q of a part of a block: sample by sample, or the range of each of few groups.

    Returns
    -------
    dict
        ``from_s`` and ``step_s``; ``i`` and ``q`` lists of the values, or ``i_low``, ``i_high``
        and so on where samples are grouped.
    """
    active = np.flatnonzero(samples)
    length = max(8, samples.size // max(1, zoom))
    first = 0 if zoom == 1 or not active.size else min(int(active[0]), samples.size - length)
    part = samples[first : first + length]
    group = math.ceil(part.size / POINTS)
    drawn: dict[str, Any] = {"from_s": first / rate_hz, "step_s": group / rate_hz}
    for name, values in (("i", part.real), *([] if real else [("q", part.imag)])):
        if group == 1:
            drawn[name] = _rounded(values)
            continue
        padded = np.pad(values, (0, -values.size % group), mode="edge").reshape(-1, group)
        drawn[f"{name}_low"] = _rounded(padded.min(axis=1))
        drawn[f"{name}_high"] = _rounded(padded.max(axis=1))
    return drawn


def spectrum(samples: NDArray[np.complex128], rate_hz: float, *, real: bool) -> dict[str, Any]:
    """Power of each line of a block [dB re 1 mW, or re 1 V^2 for rails].

    Hann window, scaled by its coherent gain: a tone of power P peaks at P, the sine of a real
    signal too. Of groups of bins the highest is drawn.

    Returns
    -------
    dict
        ``from_hz``, ``step_hz``, ``resolution_hz`` (of one bin) and ``db``.
    """
    size = samples.size
    window = np.hanning(size + 1)[:-1] if size > 2 else np.ones(size)
    gain = window.sum()
    if real:
        # Both halves of a sine's power are drawn at its one frequency.
        lines = np.fft.rfft(samples.real * window) / gain
        power = np.abs(lines) ** 2
        power[1:] *= 2.0
        from_hz = 0.0
    else:
        power = np.abs(np.fft.fftshift(np.fft.fft(samples * window)) / gain) ** 2
        from_hz = -(size // 2) * rate_hz / size
    group = math.ceil(power.size / BINS)
    padded = np.pad(power, (0, -power.size % group)).reshape(-1, group).max(axis=1)
    with np.errstate(divide="ignore"):
        levels_db = np.maximum(10.0 * np.log10(padded), _FLOOR_DB)
    bin_hz = rate_hz / size
    return {
        "from_hz": from_hz + 0.5 * (group - 1) * bin_hz,
        "step_hz": group * bin_hz,
        "resolution_hz": bin_hz,
        "db": np.round(levels_db, 1).tolist(),
    }


def plane(samples: NDArray[np.complex128]) -> dict[str, Any]:
    """Samples in the I/Q plane, evenly picked; scaled so that the largest lies within 1."""
    active = samples[samples != 0]
    picked = active[:: math.ceil(active.size / DOTS)] if active.size else active
    largest = float(np.abs(picked).max()) if picked.size else 1.0
    dots = picked / largest
    return {
        "kind": "samples",
        "scale": _significant(largest),
        "i": np.round(dots.real, 3).tolist(),
        "q": np.round(dots.imag, 3).tolist(),
    }


def _rounded(values: NDArray[np.float64]) -> list[float]:
    """Values with four digits of the largest, as short numbers."""
    largest = float(np.abs(values).max()) if values.size else 0.0
    if largest == 0.0:
        return [0.0] * int(values.size)
    digits = 4 - math.ceil(math.log10(largest))
    return [float(f"{value:.4g}") for value in np.round(values, digits).tolist()]


def _significant(value: float) -> float:
    return float(f"{value:.4g}")


def _finite(value: float) -> float | None:
    return round(value, 2) if math.isfinite(value) else None
