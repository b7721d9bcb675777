"""The calibration rig: measures the delay of each transponder before its train goes into service.

The delay of a transponder counts like distance: 1 us is 150 m. Units differ by nanoseconds, so
each is measured over a cable of known length and trimmed to the delay of the fleet, which the
stations then take off. What the rig's own noise leaves is the residual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rail_corridor.scenario.model import Scenario
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_signals.ranging.transponder import calibrate_delay

from .section import SIGNAL, TRANSPONDER, TransponderPlan

RIG_SNR = 1e4  # 40 dB per sample over the cable


@dataclass(frozen=True)
class Transponder:
    """One unit: its true delay, the trim that calibration found, and the error left."""

    delay_s: float
    trim_s: float
    residual_m: float
    sigma_m: float


def transponders_of(scenario: Scenario) -> dict[str, Transponder]:
    """The unit of every train, by its name."""
    return scenario.derive(_calibrated)


def _calibrated(scenario: Scenario) -> dict[str, Transponder]:
    seeds = np.random.SeedSequence([scenario.seed, 2]).spawn(max(1, len(scenario.trains)))
    plan, signal = TRANSPONDER.of(scenario), SIGNAL.of(scenario).signal
    return {
        train.name: calibrate(plan, signal, np.random.default_rng(seed))
        for train, seed in zip(scenario.trains, seeds, strict=False)
    }


def calibrate(
    plan: TransponderPlan, signal: RangingSignal, rng: np.random.Generator
) -> Transponder:
    """Make one unit and calibrate it.

    Parameters
    ----------
    plan : TransponderPlan
        Nominal delay, spread of the units, bursts on the calibration rig.
    signal : RangingSignal
    rng : Generator
        Draws the unit and the noise of the rig.
    """
    delay_s = max(0.0, plan.delay_s + plan.spread_s * float(rng.standard_normal()))
    lag_rad = 2.0 * np.pi * np.asarray(signal.tones_hz) * delay_s
    noise = rng.standard_normal((plan.calibration_bursts, signal.samples, 2)).view(np.complex128)
    bursts = modulate(signal, lag_rad) + noise[..., 0] * np.sqrt(0.5 / RIG_SNR)
    estimate = FmToneReceiver(signal).estimate(bursts)
    measured_s, variance_s2 = calibrate_delay(
        estimate.phase_lag_rad,
        estimate.variance_rad2,
        0.0,
        signal.tones_hz,
        nominal_delay_s=plan.delay_s,
    )
    half_c = SPEED_OF_LIGHT_M_PER_S / 2.0
    return Transponder(
        delay_s,
        plan.delay_s - measured_s,
        (delay_s - measured_s) * half_c,
        float(np.sqrt(variance_s2)) * half_c,
    )
