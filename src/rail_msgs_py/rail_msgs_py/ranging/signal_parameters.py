"""The ranging signal as node parameters, the same at the wayside and on board."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.parameters import parameter
from rail_signals.ranging.signal import RangingSignal


@dataclass(frozen=True)
class SignalParameters:
    """Tones and sampling of the ranging signal."""

    tones_hz: tuple[float, ...] = parameter(
        (375e3,), "ranging tones, highest first; one or two", unit="Hz", low=1.0
    )
    deviations_hz: tuple[float, ...] = parameter(
        (375e3,), "peak frequency deviation of each tone", unit="Hz", low=1.0
    )
    sample_rate_hz: float = parameter(4e6, "complex sample rate", unit="Hz", low=1e3, high=1e9)
    samples: int = parameter(960, "samples of one burst", low=8, high=31250)


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
