"""The accuracy that geometry allows: Cramér-Rao bound of Doppler positions along a line."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S

from .surveyed_line import SurveyedLine
from .tone_plan import TonePlan

_DERIVATIVE_M = 0.5
#: What is left of the information on the chainage below this fraction of it is rounding.
_LEAST_FRACTION = 1e-11


def shift_variance_hz2(plan: TonePlan, snr: ArrayLike) -> FloatArray:
    """Bound of the variance of a tone's shift, ``6 fs^2 / ((2 pi)^2 gamma N (N^2 - 1))`` [Hz^2]."""
    count = plan.samples
    return np.asarray(
        6.0
        * plan.sample_rate_hz**2
        / ((2.0 * np.pi) ** 2 * np.asarray(snr, dtype=np.float64) * count * (count**2 - 1.0))
    )


def shift_information(
    plan: TonePlan,
    line: SurveyedLine,
    stations_m: ArrayLike,
    chainage_m: ArrayLike,
    speed_mps: ArrayLike,
    variance_hz2: ArrayLike,
    *,
    coverage_range_m: float = np.inf,
) -> FloatArray:
    """Fisher information of a block on chainage, speed and offset [points, 3, 3].

    In 1/m^2, 1/(m/s)^2 and 1/Hz^2; the parameters are those of `position_bound_m`.
    """
    places = np.asarray(chainage_m, dtype=np.float64)
    antennas = np.asarray(stations_m, dtype=np.float64)
    speed = np.broadcast_to(np.asarray(speed_mps, dtype=np.float64), places.shape)
    run_m = speed * plan.averaging_time_s

    def mean_rate(at: FloatArray) -> FloatArray:
        return 0.5 * (line.rates(antennas, at - run_m) + line.rates(antennas, at + run_m))

    per_mps = -plan.carrier_hz / SPEED_OF_LIGHT_M_PER_S
    rows = np.ones((*places.shape, antennas.shape[0], 3))
    bend = mean_rate(places + _DERIVATIVE_M) - mean_rate(places - _DERIVATIVE_M)
    rows[..., 0] = per_mps * speed[..., None] * bend / (2.0 * _DERIVATIVE_M)
    rows[..., 1] = per_mps * mean_rate(places)
    received = line.distances(antennas, places) <= coverage_range_m
    weight = np.where(received, 1.0 / np.broadcast_to(variance_hz2, received.shape), 0.0)
    return np.asarray(np.einsum("...na,...n,...nb->...ab", rows, weight, rows))


def position_bound_m(
    plan: TonePlan,
    line: SurveyedLine,
    stations_m: ArrayLike,
    chainage_m: ArrayLike,
    speed_mps: ArrayLike,
    variance_hz2: ArrayLike,
    *,
    coverage_range_m: float = np.inf,
    offset_sigma_hz: float = np.inf,
    speed_sigma_mps: float = np.inf,
) -> FloatArray:
    """Least standard deviation of an unbiased position [points], infinite where there is none.

    Parameters
    ----------
    plan : TonePlan
    line : SurveyedLine
    stations_m : float [stations, 3]
    chainage_m : float [points]
    speed_mps : float, or [points]
    variance_hz2 : float, or [points, stations]
        Of the shifts [Hz^2].
    coverage_range_m : float
        Stations farther away are not heard [m].
    offset_sigma_hz, speed_sigma_mps : float
        How well the receiver's offset and the speed are known beforehand; 0 = exactly.

    Examples
    --------
    Two stations 1000 m apart and 50 m off the track, 300 km/h, one hertz: 49.7 m in the middle.

    >>> s = np.arange(-1000.0, 1001.0, 5.0)
    >>> line = SurveyedLine(s, s, 0.0 * s, 0.0 * s, 0.0 * s)
    >>> stations = [[-500.0, 50.0, 0.0], [500.0, 50.0, 0.0]]
    >>> bound = position_bound_m(
    ...     TonePlan(), line, stations, [0.0, 250.0], 300 / 3.6, 1.0, offset_sigma_hz=0.0
    ... )
    >>> bound.round(1).tolist()
    [49.7, 12.4]
    """
    information = shift_information(
        plan,
        line,
        stations_m,
        chainage_m,
        speed_mps,
        variance_hz2,
        coverage_range_m=coverage_range_m,
    )
    known = [0, *(i for i, s in ((1, speed_sigma_mps), (2, offset_sigma_hz)) if s > 0.0)]
    information = information[..., known, :][..., known]
    for place, number in enumerate(known):
        sigma = {1: speed_sigma_mps, 2: offset_sigma_hz}.get(number, np.inf)
        if np.isfinite(sigma):
            information[..., place, place] += sigma**-2
    # Scaled to unit diagonal, so that rank is seen whatever the units.
    diagonal = np.sqrt(np.einsum("...aa->...a", information))
    safe = np.where(diagonal > 0.0, diagonal, 1.0)
    scaled = information / (safe[..., :, None] * safe[..., None, :])
    values, vectors = np.linalg.eigh(scaled)
    ranked = values > 1e-13
    parts = np.where(ranked, vectors[..., 0, :] ** 2 / np.where(ranked, values, 1.0), 0.0)
    open_ = (~ranked & (np.abs(vectors[..., 0, :]) > 1e-6)).any(axis=-1)
    bound = np.sqrt(parts.sum(axis=-1)) / safe[..., 0]
    return np.asarray(np.where(open_ | (diagonal[..., 0] == 0.0), np.inf, bound))


def tracked_bound_m(
    information: FloatArray,
    available: ArrayLike,
    *,
    offset_sigma_hz: float,
    walk_hz: float,
    speed_sigma_mps: float,
) -> FloatArray:
    """Bound of the positions of a run whose offset is carried on from block to block [blocks].

    Parameters
    ----------
    information : float [blocks, 3, 3]
        Of `shift_information`, block after block.
    available : bool [blocks]
        Whether the offset found with a block is carried on.
    offset_sigma_hz, speed_sigma_mps : float
        How well the receiver's offset is known at first, and the speed at any time.
    walk_hz : float
        Random walk of the offset from block to block, standard deviation [Hz].
    """
    bound = np.empty(information.shape[0])
    variance = offset_sigma_hz**2
    for block, (mine, carried) in enumerate(zip(information, np.asarray(available), strict=True)):
        total = mine.copy()
        total[1, 1] += speed_sigma_mps**-2
        total[2, 2] += 1.0 / variance
        # Speed and offset first: they always have information, the chainage may have none.
        rest = np.linalg.inv(total[1:, 1:])
        chainage = total[0, 0] - total[0, 1:] @ rest @ total[1:, 0]
        certain = chainage > _LEAST_FRACTION * total[0, 0]
        bound[block] = chainage**-0.5 if certain else np.inf
        if carried and certain:
            gain = rest @ total[1:, 0]
            variance = rest[1, 1] + gain[1] ** 2 * bound[block] ** 2
        variance += walk_hz**2
    return bound
