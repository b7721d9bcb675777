"""What theory says of a point of the link-margin sweep: lost frames and spurious brakings.

The mean level along the stretch is that of the geometry. At every place the loss p of a frame is

* ``at rest``: one channel throughout the frame (`block_fading_frame_loss`, closed form), and
* ``running``: the mean of ``1 - prod over bits of (1 - p_bit(gamma g(t)))`` over drawn channels
  that follow Jakes' covariance ``J0(2 pi f_D t)`` through the frame; at 80 km/h and 2.4 GHz a
  frame of 3 ms sees half a wavelength.

Both know the channel; what its estimate from pilots costs is taken as a loss of Es/N0,
``(1 - e) / (1 + e Es/N0)`` with the mean fraction e of the estimator's error in the power.
Authority is lost after n losses in a row; from place to place these are independent, a tick being
two wavelengths and more, so that brakings come once in ``(1 - p^n) / ((1 - p) p^n)`` ticks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.special import j0

from rail_corridor.equipment.train_radio.nodes import burst_format
from rail_corridor.equipment.train_radio.section import CBTC
from rail_corridor.equipment.train_radio.world import cbtc_description
from rail_corridor.scenario.model import Scenario
from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.train_radio.ber.closed_form import (
    block_fading_frame_loss,
    conditional_error_rate,
    mean_messages_until_losses,
)
from rail_signals.train_radio.burst import RadioBurstFormat
from rail_signals.train_radio.pilot_estimation import wiener_estimator
from rail_signals.train_radio.space_time_block import Scheme
from rail_signals.train_radio.space_time_block import scheme as by_name
from rail_world.train_radio.links import COLUMNS
from rail_world.train_radio.medium import CbtcMedium

SPEED_MPS: Final = 80.0 / 3.6
_BITS_PER_SYMBOL = 2
_INSTANTS = 24
_DRAWS = 4000
_GRID_DB: Final = np.arange(0.0, 45.0, 1.5)
_LEAST_LOSS = 1e-15


@dataclass(frozen=True)
class LinkPrediction:
    """What theory says of a point.

    ``es_n0_db`` median over the stretch of the mean Es/N0 per receive antenna [dB];
    ``frame_loss_at_rest`` and ``frame_loss`` (running) means over the stretch;
    ``brakings_per_hour`` of a running train, 0 where it is below any meaning.
    """

    es_n0_db: float
    frame_loss_at_rest: float
    frame_loss: float
    brakings_per_hour: float


def predict(scenario: Scenario, from_fraction: float = 0.3) -> LinkPrediction:
    """Theory for a scenario whose link is weak from a fraction of its track on."""
    plan = CBTC.of(scenario)
    assert plan is not None
    levels_db = line_es_n0_db(scenario, from_fraction)
    losses = math.floor(plan.timeout_s / scenario.tick_s + 1e-9)
    return theory(plan.scheme, levels_db, burst_format(plan), losses, scenario.tick_s)


def theory(
    scheme: str, levels_db: FloatArray, burst: RadioBurstFormat, losses: int, tick_s: float
) -> LinkPrediction:
    """Means over places of Es/N0 per receive antenna [place, dB].

    ``losses`` frames in a row, one in each tick of ``tick_s`` [s], make a train brake.
    """
    running = _running(scheme, levels_db, burst)
    eb_n0 = 10.0 ** (_effective_db(levels_db, burst) / 10.0) / _BITS_PER_SYMBOL
    at_rest = block_fading_frame_loss(by_name(scheme), eb_n0, burst.data_bits)
    return LinkPrediction(
        float(np.median(levels_db)),
        float(at_rest.mean()),
        float(running.mean()),
        brakings_per_hour(scheme, levels_db, burst, losses, tick_s),
    )


def brakings_per_hour(
    scheme: str, levels_db: FloatArray, burst: RadioBurstFormat, losses: int, tick_s: float
) -> float:
    """Spurious brakings per hour of a running train, parameters as of `theory`."""
    p = np.clip(_running(scheme, levels_db, burst), _LEAST_LOSS, 1.0 - 1e-9)
    return float(3600.0 * np.mean(1.0 / (mean_messages_until_losses(p, losses) * tick_s)))


def _running(scheme: str, levels_db: FloatArray, burst: RadioBurstFormat) -> FloatArray:
    """Loss of a frame at full speed [place]."""
    loss = np.interp(levels_db, _GRID_DB, np.log(running_loss(scheme, burst)))
    return np.asarray(np.exp(loss))


def line_es_n0_db(scenario: Scenario, from_fraction: float, step_m: float = 10.0) -> FloatArray:
    """Mean Es/N0 per receive antenna of the best downlink along the first track [place, dB]."""
    description, plan = cbtc_description(scenario), CBTC.of(scenario)
    assert description is not None and plan is not None
    medium = CbtcMedium(description, scenario.seed, scenario.tick_s)
    track = next(iter(scenario.network.tracks.values()))
    trains = len(description.trains)
    places_m = np.arange(from_fraction * track.length_m, track.length_m, step_m)
    places_m = places_m[: len(places_m) // trains * trains]
    best: list[FloatArray] = []
    for batch_m in places_m.reshape(-1, trains):
        pose = track.pose(batch_m)
        state = np.zeros((trains, len(COLUMNS)))
        for name in ("x_m", "y_m", "z_m", "heading_rad"):
            state[:, COLUMNS.index(name)] = getattr(pose, name)
        state[:, COLUMNS.index("chainage_m")] = batch_m
        state[:, COLUMNS.index("on_line")] = 1.0
        best.append(medium.snr(medium.links(1, scenario.tick_s, state)).max(axis=0))
    return np.asarray(10.0 * np.log10(np.concatenate(best) * plan.samples_per_symbol))


@lru_cache(maxsize=16)
def running_loss(scheme: str, burst: RadioBurstFormat, carrier_hz: float = 2.4e9) -> FloatArray:
    """Loss of a frame at full speed for the levels of a grid."""
    antennas = by_name(scheme)
    gains = fading_energy(antennas, burst, carrier_hz)
    bits = burst.data_bits / _INSTANTS
    eb_n0 = 10.0 ** (_effective_db(_GRID_DB, burst) / 10.0) / _BITS_PER_SYMBOL
    loss = np.empty(len(_GRID_DB))
    for index, level in enumerate(eb_n0 / antennas.transmit):
        p = conditional_error_rate(level * gains, _BITS_PER_SYMBOL)
        loss[index] = -np.expm1(bits * np.log1p(-p).sum(axis=1)).mean()
    return np.maximum(loss, _LEAST_LOSS)


def fading_energy(scheme: Scheme, burst: RadioBurstFormat, carrier_hz: float) -> FloatArray:
    """Sum of the branches' power gains at instants through drawn frames [draw, instant]."""
    rng = np.random.default_rng([burst.data_bits, scheme.diversity])
    time_s = np.linspace(0.0, burst.pattern.symbols / burst.symbol_rate_hz, _INSTANTS)
    doppler_hz = SPEED_MPS * carrier_hz / SPEED_OF_LIGHT_M_PER_S
    covariance = j0(2.0 * math.pi * doppler_hz * (time_s[:, None] - time_s))
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0) / 2.0)
    parts = rng.standard_normal((_DRAWS, 2 * scheme.diversity, _INSTANTS)) @ root.T
    return np.asarray((parts**2).sum(axis=1))


def _effective_db(levels_db: FloatArray, burst: RadioBurstFormat) -> FloatArray:
    """Es/N0 that a known channel would need for the same [dB]."""
    doppler = SPEED_MPS * 2.45e9 / SPEED_OF_LIGHT_M_PER_S / burst.symbol_rate_hz
    level = 10.0 ** (levels_db / 10.0)
    error = wiener_estimator(burst.pattern, doppler).error_variance(level)
    fraction = error.reshape(len(level), -1).mean(axis=1)
    return np.asarray(10.0 * np.log10(level * (1.0 - fraction) / (1.0 + fraction * level)))
