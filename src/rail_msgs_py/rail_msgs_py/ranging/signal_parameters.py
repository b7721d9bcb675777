"""The ranging signal as node parameters, the same at the wayside and on board."""

from __future__ import annotations

from dataclasses import dataclass

from rail_signals.ranging.signal import RangingSignal

from . import quantities


@dataclass(frozen=True)
class SignalParameters:
    """Tones and sampling of the ranging signal."""

    tones_hz: tuple[float, ...] = quantities.TONES.parameter()
    deviations_hz: tuple[float, ...] = quantities.DEVIATIONS.parameter()
    sample_rate_hz: float = quantities.SAMPLE_RATE.parameter()
    samples: int = quantities.SAMPLES.parameter()


def signal_of(parameters: SignalParameters) -> RangingSignal:
    """Ranging signal of the parameters.

    Raises
    ------
    ValueError
        If they make no signal; the line names the field and the value.
    """
    return RangingSignal(
        tuple(parameters.tones_hz),
        tuple(parameters.deviations_hz),
        parameters.sample_rate_hz,
        parameters.samples,
    )
