"""The line receiver written down in NumPy, one burst at a time, as its documentation has it."""

from __future__ import annotations

import math

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.ranging.fm_spectrum import fm_spectrum
from rail_signals.ranging.signal import RangingSignal

STRONG = 0.92


def plain_estimate(
    signal: RangingSignal, burst: ComplexArray, max_offset_hz: float, segments: int, max_snr: float
) -> dict[str, FloatArray]:
    """Fields of `ToneEstimate` of one burst [samples] that holds a signal."""
    components, period, samples = fm_spectrum(signal), signal.period_samples, signal.samples
    burst = burst.astype(np.complex128)
    offset_hz = plain_offset_hz(signal, burst, max_offset_hz, segments) if max_offset_hz else 0.0
    time_s = (np.arange(samples) - (samples - 1) / 2) / signal.sample_rate_hz
    still = burst * np.exp(-2j * math.pi * offset_hz * time_s)
    folded = still.reshape(-1, period).sum(axis=0)
    lines = np.fft.fft(folded)[components.bins] / samples
    orders, amplitudes = components.orders, components.amplitudes
    phase = np.array(
        [neighbour_phase(orders, amplitudes, lines, t) for t in range(orders.shape[1])]
    )
    turned = lines * np.exp(1j * orders @ phase)
    information, power = components.information, components.power
    amplitude = (turned @ amplitudes) / power
    steps = (turned @ (orders * amplitudes[:, None])) / information
    slope = (steps * np.conj(amplitude)).imag
    step = slope / abs(amplitude) ** 2
    explained = abs(amplitude) ** 2 + (slope * step * information / power).sum()
    periods = samples // period
    energy, inside = np.sum(np.abs(burst) ** 2), np.sum(np.abs(folded) ** 2) / periods
    noise = max((energy - inside) / (samples - period), explained / max_snr)
    degrees = len(lines) - 1 - len(phase) / 2
    left = np.sum(np.abs(lines) ** 2) - explained * power
    return {
        "phase_lag_rad": np.mod(phase - step, 2 * math.pi),
        "variance_rad2": 0.5 / (samples * information) * noise / explained,
        "amplitude": np.sqrt(explained),
        "snr": np.asarray(explained / noise),
        "frequency_offset_hz": np.asarray(offset_hz),
        "reduced_chi_square": np.asarray(left * samples / degrees / noise),
    }


def neighbour_phase(
    orders: np.ndarray, amplitudes: FloatArray, lines: ComplexArray, tone: int
) -> float:
    """Lag of a tone by the products of components one order apart."""
    where = {tuple(order): i for i, order in enumerate(orders.tolist())}
    total = 0j
    for order, upper in where.items():
        lower = where.get((*order[:tone], order[tone] - 1, *order[tone + 1 :]))
        if lower is not None:
            weight = amplitudes[upper] * amplitudes[lower]
            total += weight * np.conj(lines[upper]) * lines[lower]
    return float(np.angle(total))


def plain_offset_hz(
    signal: RangingSignal, burst: ComplexArray, max_offset_hz: float, segments: int
) -> float:
    """Peak of the summed power of the strong components on the grid, interpolated."""
    strong, period = fm_spectrum(signal).strongest(STRONG), signal.period_samples
    step_hz = 0.5 / signal.duration_s
    half = math.ceil(max_offset_hz / step_hz) + 1
    grid_hz = step_hz * np.arange(-half, half + 1)
    long = signal.samples // segments
    turn = np.exp(-2j * math.pi / period * np.outer(np.arange(long), strong.bins))
    lines = burst.reshape(segments, long) @ turn
    centre_s = (np.arange(segments) - (segments - 1) / 2) * long / signal.sample_rate_hz
    response = np.exp(-2j * math.pi * np.outer(grid_hz, centre_s)) @ lines
    power = np.sum(np.abs(response) ** 2, axis=1)
    peak = 1 + int(np.argmax(power[1:-1]))
    total = np.sum(np.abs(response[peak + 1] + response[peak - 1]) ** 2)
    quotient = (power[peak + 1] - power[peak - 1]) / total
    arc = math.atan(quotient * math.tan(math.pi / (2 * segments)))
    return float(grid_hz[peak] + segments / math.pi / signal.duration_s * arc)
