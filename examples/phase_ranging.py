"""One burst there and back: the range from the phase of a tone, in pure functions.

Run:  python examples/phase_ranging.py
See:  the true distance, the measured one, its claimed sigma and the bound, for some distances.
"""

from __future__ import annotations

import numpy as np

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.delay import fractional_delay
from rail_signals.ranging.bounds import two_way_range_variance_bound
from rail_signals.ranging.phase_range import phase_to_range_m, range_per_radian_m
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_signals.ranging.transponder import transpond

TRANSPONDER_DELAY_S = 1e-6
SNR = 100.0  # 20 dB per sample, on both legs


def receive(
    burst: np.ndarray, distance_m: float, signal: RangingSignal, rng: np.random.Generator
) -> np.ndarray:
    """Return what arrives of a burst of unit amplitude over a distance, with noise."""
    delay_s = np.array([distance_m / SPEED_OF_LIGHT_M_PER_S])
    arrived = fractional_delay(burst[None, :], delay_s, signal.sample_rate_hz)[0]
    noise = rng.standard_normal((signal.samples, 2)) @ (1.0, 1j)
    return arrived + noise * np.sqrt(0.5 / SNR)


def main() -> None:
    """Range a train at several distances."""
    signal, rng = RangingSignal(), np.random.default_rng(1)
    receiver = FmToneReceiver(signal)
    tone_hz = signal.tones_hz[0]
    bound_m = np.sqrt(
        two_way_range_variance_bound(SNR, SNR, signal.samples, signal.indices[0], tone_hz)
    )
    sent = modulate(signal, np.zeros(1))
    print("     true  measured     sigma     bound")
    for distance_m in (10.0, 50.0, 120.0, 199.0):
        on_board = receiver.estimate(receive(sent, distance_m, signal, rng))
        reply = transpond(on_board, signal, TRANSPONDER_DELAY_S)
        back = receiver.estimate(receive(reply, distance_m, signal, rng))
        measured_m = phase_to_range_m(back.phase_lag_rad[0], tone_hz, delay_s=TRANSPONDER_DELAY_S)
        # The station sees one leg of two that are alike.
        sigma_m = np.sqrt(2.0 * back.variance_rad2[0]) * range_per_radian_m(tone_hz)
        print(f"{distance_m:7.1f} m{measured_m:8.2f} m{sigma_m:8.3f} m{bound_m:8.3f} m")


if __name__ == "__main__":
    main()
