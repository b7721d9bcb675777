"""Symbols of train radio bursts, as the receiver sees them before it decides."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.waveform import Waveform
from rail_signals.train_radio.burst import RadioBurstFormat, RadioBurstReceiver
from rail_signals.train_radio.slots import RadioSlots
from rail_signals.train_radio.space_time_block import scheme
from rail_signals.train_radio.symbol_mapping import constellation


class BurstReader:
    """Finds the strongest burst of a block and reads its symbols.

    Parameters
    ----------
    described : mapping
        ``bursts`` of the announced scenario.
    """

    def __init__(self, described: Mapping[str, Any]) -> None:
        burst = RadioBurstFormat(
            scheme(described["scheme"]),
            constellation(described["constellation"]),
            int(described["data_bits"]),
            float(described["symbol_rate_hz"]),
            int(described["samples_per_symbol"]),
            pilot_period=int(described["pilot_period"]),
        )
        self._burst = burst
        self._doppler_hz = float(described["doppler_hz"])
        self._receiver = RadioBurstReceiver(burst)
        self._points = [
            [round(float(point.real), 4), round(float(point.imag), 4)]
            for point in burst.constellation.points
        ]

    def symbols(self, block: Waveform, antenna: int) -> dict[str, Any] | None:
        """Data symbols of the strongest slot of a block; None if it holds no bursts.

        Behind channel estimate and combining where the burst can be received - as many antennas as
        the scheme receives by - else behind the matched filter of one antenna.
        """
        burst, samples = self._burst, block.samples
        of_rate = math.isclose(block.sample_rate_hz, burst.sample_rate_hz)
        if not of_rate or samples.shape[1] % burst.samples:
            return None
        slots = RadioSlots(burst, max(1, samples.shape[1] // burst.samples - 1))
        if slots.samples != samples.shape[1]:
            return None
        cut = slots.cut(samples)
        slot = int(np.argmax(np.sum(np.abs(cut) ** 2, axis=(1, 2))))
        pattern = burst.pattern
        receive = burst.scheme.receive
        if samples.shape[0] >= receive:
            waves = cut[slot, :receive]
            found = self._receiver.receive(waves, doppler_hz=self._doppler_hz)
            if found.detected:
                data = pattern.data_positions
                y, h = burst.symbols_of(waves)[..., data], found.channel[..., data]
                symbols, _ = burst.scheme.combine(y, h)
                snr_db = 10.0 * float(np.log10(max(float(np.mean(found.snr)), 1e-9)))
                return self._drawn("symbols", symbols, slot, snr_db)
        sent = burst.symbols_of(cut[slot, antenna])[pattern.data_positions]
        level = float(np.sqrt(np.mean(np.abs(sent) ** 2)))
        return self._drawn("matched", sent / level if level > 0.0 else sent, slot, None)

    def _drawn(
        self, kind: str, symbols: NDArray[np.complex128], slot: int, snr_db: float | None
    ) -> dict[str, Any]:
        return {
            "kind": kind,
            "constellation": self._burst.constellation.name,
            "slot": slot,
            "snr_db": None if snr_db is None else round(snr_db, 1),
            "i": np.round(symbols.real, 3).tolist(),
            "q": np.round(symbols.imag, 3).tolist(),
            "points": self._points,
        }
