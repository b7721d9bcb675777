"""Compiled propagation against delays, shifts and sums in NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.delay import fractional_delay
from rail_world.ranging.path_kernels import add_links, carry

C_MPS, RATE_HZ = 299_792_458.0, 4e6


@pytest.mark.parametrize("uplink", [False, True])
@pytest.mark.parametrize("periods", [(32, 32), (64, 320), (5, 1)])
def test_every_link_is_delayed_shifted_and_added(uplink: bool, periods: tuple[int, ...]) -> None:
    rng = np.random.default_rng(periods[0])
    samples, shape = 320, (2, 2)
    one = [rng.normal(size=(period, 2)) @ [1, 1j] for period in periods]
    spectra = np.zeros((2, max(periods)), dtype=complex)
    for row, block in zip(spectra, one, strict=True):
        row[: len(block)] = np.fft.fft(block)
    distance_m = rng.uniform(1.0, 3000.0, shape)
    closing_mps, gain_db = rng.normal(0.0, 50.0, shape), rng.normal(0.0, 5.0, shape)
    station, train = rng.normal(0.0, 1e-6, 2), rng.normal(0.0, 1e-6, 2)
    carrier_hz, loss_db = np.array([0.0, 2.4e9]), np.array([0.0, 3.0])
    links = np.empty((4, 5), np.int64), np.empty((4, 2)), np.empty((4, max(periods)), complex)
    powers = np.array([np.mean(np.abs(block) ** 2) for block in one])
    count, ports = carry(
        uplink,
        (np.arange(2), np.ones(2, np.int64), np.array(periods), powers, spectra),
        (np.ones(2, np.int64), np.ones(2, np.bool_), station),
        train,
        (carrier_hz, loss_db),
        (np.ones(shape, np.bool_), distance_m, closing_mps, gain_db),
        (0.0, C_MPS, RATE_HZ),
        links,
    )
    assert (count, ports) == (4, 2)
    table, values, arrived = links
    for row, period in enumerate(table[:, 3].tolist()):
        arrived[row, :period] = np.fft.ifft(arrived[row, :period])
    heard = np.zeros((2, 2 * samples), np.float32)
    add_links(table, values, arrived.view(np.float64), heard)
    middle = np.arange(samples) - 0.5 * (samples - 1)
    expected = np.zeros((2, samples), dtype=complex)
    for port, s, t, _, strongest in table.tolist():
        sender, receiver = (t, s) if uplink else (s, t)
        assert port == receiver
        delay_s = distance_m[s, t] / C_MPS
        offset = (station[s] - train[t]) * (-1.0 if uplink else 1.0)
        cycles = carrier_hz[1] * (closing_mps[s, t] / C_MPS + offset) / RATE_HZ
        amplitude = 10.0 ** ((gain_db[s, t] - 3.0) / 20.0)
        turns = cycles * middle - carrier_hz[1] * delay_s % 1.0
        block = np.tile(one[sender], samples // periods[sender])
        delayed = fractional_delay(block, delay_s, RATE_HZ)
        expected[port] += amplitude * delayed * np.exp(2j * math.pi * turns)
        both = [(gain_db[s, t], powers[sender])]
        other = (s, 1 - t) if uplink else (1 - s, t)
        both.append((gain_db[other], powers[other[1 if uplink else 0]]))
        first, second = (gain + 10.0 * math.log10(power) for gain, power in both)
        assert bool(strongest) == (first > second)
    np.testing.assert_allclose(heard.view(np.complex64), expected, atol=2e-5)
