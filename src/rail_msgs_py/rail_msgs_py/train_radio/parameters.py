"""The train radio as node parameters, the same at the wayside and on board."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.parameters import parameter
from rail_signals.train_radio.burst import RadioBurstFormat
from rail_signals.train_radio.slots import RadioSlots
from rail_signals.train_radio.space_time_block import scheme
from rail_signals.train_radio.symbol_mapping import constellation

from . import quantities
from .safe_frame import FRAME_BYTES


@dataclass(frozen=True)
class TrainRadioParameters:
    """Bursts, slots and what a receiver expects."""

    scheme: str = quantities.SCHEME.parameter()
    constellation: str = quantities.CONSTELLATION.parameter()
    symbol_rate_hz: float = quantities.SYMBOL_RATE.parameter()
    samples_per_symbol: int = quantities.SAMPLES_PER_SYMBOL.parameter()
    pilot_period: int = quantities.PILOT_PERIOD.parameter()
    trains: int = parameter(1, "slots of trains", low=1, high=1000)
    doppler_hz: float = parameter(
        0.0, "largest Doppler shift that receivers follow", unit="Hz", low=0.0, high=1e5
    )


def slots_of(parameters: TrainRadioParameters) -> RadioSlots:
    """Slots of the parameters.

    Raises
    ------
    ValueError
        If they make no bursts; the line names the field and the value.
    """
    burst = RadioBurstFormat(
        scheme(parameters.scheme),
        constellation(parameters.constellation),
        8 * FRAME_BYTES,
        parameters.symbol_rate_hz,
        parameters.samples_per_symbol,
        pilot_period=parameters.pilot_period,
    )
    return RadioSlots(burst, parameters.trains)
