"""The medium of the reference tones: from the stations beside the line to each train's antenna.

A train hears the sum over the stations b in reach

    y(t) = sum_b a_b x_b(t - R_b(t) / c) exp(-j 2 pi (f R_b(t) / c - delta_b t)) + w(t)

in a block whose middle is the tick. Samples are in sqrt(mW).

======= ===================================================================================
R       exact distance at every sample: the antenna runs along the track, bends and rises
        with it, at the speed and the acceleration of the tick
x       envelope, delayed by the distance at mid-block; as it moves within the block its mean
        frequency is shifted too, which is exact for a tone
a       path loss: free space at 1 m, then the exponent
delta   offset of the station's oscillator less that of the train's
w       white Gaussian noise of k T F times the sample rate
======= ===================================================================================

Left out: echoes, antenna patterns.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.delay import fractional_delay
from rail_signals.phasors import cis
from rail_world.line.network import Network
from rail_world.ranging.medium import THERMAL_NOISE_DBM_PER_HZ
from rail_world.ranging.noise import NoiseSource

from .description import ReferenceDescription

_STAGE = 21  # of the noise; the ranging radio has 1 and 2, the train radio 11 and 12
_OFFSET_STREAM = 22
_LEAST_M = 1.0


@dataclass(frozen=True)
class _TransmittedTone:
    """A block that a station sends, and the mean frequency of its envelope [Hz]."""

    samples: ComplexArray
    mean_hz: float


class ReferenceMedium:
    """Propagates the tones of one tick.

    Noise depends on nothing but (seed, train, tick), offsets on nothing but (seed, train or
    station).

    Parameters
    ----------
    description : ReferenceDescription
    network : Network
        The tracks, for curvature and slope.
    seed : int
    """

    def __init__(self, description: ReferenceDescription, network: Network, seed: int) -> None:
        self.description = description
        self._tracks = [network.tracks[name] for name in description.tracks]
        self._stations_m = np.array([s.position_m for s in description.stations])
        samples, rate_hz = description.samples, description.sample_rate_hz
        self._time_s = (np.arange(samples) - 0.5 * (samples - 1)) / rate_hz
        self._frequencies_hz = np.fft.fftfreq(samples, 1.0 / rate_hz)
        figure_db = THERMAL_NOISE_DBM_PER_HZ + description.noise_figure_db
        self.noise_mw: float = 10.0 ** (figure_db / 10.0) * rate_hz
        self._noise = NoiseSource(seed, samples)
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, _OFFSET_STREAM])))
        spread_hz = 1e-9 * description.station_ppb * description.carrier_hz
        self._station_hz = spread_hz * rng.standard_normal(len(description.stations))
        most_hz = 1e-6 * description.receiver_ppm * description.carrier_hz
        #: Offset of each train's oscillator at the carrier [Hz].
        self.receiver_hz: FloatArray = rng.uniform(-most_hz, most_hz, len(description.trains))
        wavelength_m = SPEED_OF_LIGHT_M_PER_S / description.carrier_hz
        self._at_1m_db = 20.0 * np.log10(4.0 * np.pi / wavelength_m) + description.extra_loss_db
        self._known: dict[int, _TransmittedTone] = {}

    def receive(
        self, tick: int, time_s: float, state: FloatArray, sent: Mapping[int, ComplexArray]
    ) -> dict[int, NDArray[np.complex64]]:
        """What the trains hear.

        Parameters
        ----------
        tick, time_s : int, float
            Number and simulated time of the tick [s].
        state : array [train, column]
            The truth, columns as `STATE.columns`.
        sent : mapping
            Index of a station -> samples [samples], sqrt(mW); silent ones are missing. An array
            that is passed again is taken to hold the same samples.

        Returns
        -------
        train -> complex64 [samples]; trains off the line, or without a sending station in reach,
        are missing.

        Raises
        ------
        ValueError
            If a block has not the length of the description.
        """
        shift_hz = self._station_hz.copy()
        dead = set()
        names = {station.name: index for index, station in enumerate(self.description.stations)}
        for fault in self.description.faults:
            if fault.acts(time_s):
                if fault.shift_hz is None:  # a dead station
                    dead.add(names[fault.station])
                else:
                    shift_hz[names[fault.station]] += fault.shift_hz
        on_line = np.flatnonzero(state[:, STATE.index["on_line"]] > 0.0).tolist()
        received: dict[int, NDArray[np.complex64]] = {}
        for train in on_line:
            here = state[train, 1:4]
            away_m = np.sqrt(((self._stations_m - here) ** 2).sum(axis=1))
            near = np.flatnonzero(away_m <= self.description.coverage_range_m).tolist()
            near = [station for station in near if station in sent and station not in dead]
            if not near:
                continue
            distance_m = self._distances(state[train], near)
            total = self._noise.blocks(_STAGE, [train], tick, np.array([self.noise_mw]))[0]
            for row, station in enumerate(near):
                offset_hz = shift_hz[station] - self.receiver_hz[train]
                total += self._arrived(sent[station], station, distance_m[row], offset_hz)
            received[train] = total
        return received

    def snr(self, distance_m: FloatArray, power_mw: float) -> FloatArray:
        """Signal-to-noise ratio per sample of a station at a distance, linear."""
        return np.asarray(power_mw * 10.0 ** (self._gain_db(distance_m) / 10.0) / self.noise_mw)

    def _gain_db(self, distance_m: FloatArray) -> FloatArray:
        near = np.maximum(distance_m, _LEAST_M)
        exponent = self.description.path_loss_exponent
        return np.asarray(-self._at_1m_db - 10.0 * exponent * np.log10(near))

    def _distances(self, row: FloatArray, stations: list[int]) -> FloatArray:
        """Distance from each station at each sample [station, sample]."""
        t = self._time_s
        path_m = (
            row[STATE.index["speed_mps"]] * t + 0.5 * row[STATE.index["acceleration_mps2"]] * t * t
        )
        track = self._tracks[int(row[STATE.index["track_index"]])]
        chainage_m = min(max(row[STATE.index["chainage_m"]], 0.0), track.length_m)
        bend_m = 0.5 * float(track.curvature_per_m(chainage_m)) * path_m * path_m
        heading = row[STATE.index["heading_rad"]]
        cos, sin = np.cos(heading), np.sin(heading)
        place = row[1:4][:, None] + np.stack(
            (
                cos * path_m - sin * bend_m,
                sin * path_m + cos * bend_m,
                1e-3 * float(track.gradient_permil(chainage_m)) * path_m,
            )
        )
        line = place[None] - self._stations_m[stations][:, :, None]
        return np.asarray(np.maximum(np.sqrt(np.einsum("skn,skn->sn", line, line)), _LEAST_M))

    def _arrived(
        self, samples: ComplexArray, station: int, distance_m: FloatArray, offset_hz: float
    ) -> ComplexArray:
        sent = self._sent(station, samples)
        middle_m = float(distance_m[len(distance_m) // 2])
        delay_s = middle_m / SPEED_OF_LIGHT_M_PER_S
        delayed = fractional_delay(sent.samples, delay_s, self.description.sample_rate_hz)
        turns = offset_hz * self._time_s
        turns -= self.description.carrier_hz / SPEED_OF_LIGHT_M_PER_S * distance_m
        turns -= sent.mean_hz / SPEED_OF_LIGHT_M_PER_S * (distance_m - middle_m)
        amplitude = 10.0 ** (self._gain_db(distance_m) / 20.0)
        return np.asarray(delayed * amplitude * cis(2.0 * np.pi * np.mod(turns, 1.0)))

    def _sent(self, station: int, samples: ComplexArray) -> _TransmittedTone:
        known = self._known.get(station)
        if known is None or known.samples is not samples:
            if samples.shape != (self.description.samples,):
                raise ValueError(
                    f"a block of {samples.shape}, not of {self.description.samples} samples"
                )
            power = np.abs(np.fft.fft(samples)) ** 2
            total = float(power.sum())
            mean_hz = float(power @ self._frequencies_hz) / total if total else 0.0
            known = self._known[station] = _TransmittedTone(samples, mean_hz)
        return known
