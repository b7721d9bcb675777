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
from rail_signals.delay import delayed
from rail_world.line.network import Network
from rail_world.ranging.medium import THERMAL_NOISE_DBM_PER_HZ
from rail_world.ranging.noise import NoiseSource

from .description import ReferenceDescription
from .path_kernel import add_tones, distances

_STAGE = 21  # of the noise; the ranging radio has 1 and 2, the train radio 11 and 12
_OFFSET_STREAM = 22
_LEAST_M = 1.0


#: Fraction of the power beside its strongest line that a tone has by rounding alone.
_NO_OTHER_LINE = 1e-20


@dataclass(frozen=True)
class _TransmittedTone:
    """A block that a station sends, its transform and the mean frequency of its envelope [Hz].

    Of a `line`, an envelope of one frequency with whole periods in the block, nothing but the
    phase is delayed.
    """

    samples: ComplexArray
    spectrum: ComplexArray
    mean_hz: float
    line: bool


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
        self._index = {station.name: row for row, station in enumerate(description.stations)}
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
        sends = np.zeros(len(shift_hz), dtype=np.bool_)
        sends[list(sent)] = True
        for fault in self.description.faults:
            if fault.acts(time_s):
                if fault.shift_hz is None:  # a dead station
                    sends[self._index[fault.station]] = False
                else:
                    shift_hz[self._index[fault.station]] += fault.shift_hz
        line = state[:, None, 1:4] - self._stations_m
        away_m = np.sqrt(np.einsum("tsk,tsk->ts", line, line))
        on_line = state[:, STATE.index["on_line"]] > 0.0
        near = (away_m <= self.description.coverage_range_m) & sends & on_line[:, None]
        train, station = np.nonzero(near)
        if not train.size:
            return {}
        trains, row = np.unique(train, return_inverse=True)
        power_mw = np.full(len(trains), self.noise_mw)
        heard = self._noise.blocks(_STAGE, trains.tolist(), tick, power_mw)
        distance_m = np.empty((len(train), self.description.samples))
        ways = self._ways(state[trains])[row]
        distances(ways, self._stations_m[station], self._time_s, _LEAST_M, distance_m)
        offset_hz = shift_hz[station] - self.receiver_hz[train]
        self._add(sent, station, row, offset_hz, distance_m, heard)
        return dict(zip(trains.tolist(), heard, strict=True))

    def snr(self, distance_m: FloatArray, power_mw: float) -> FloatArray:
        """Signal-to-noise ratio per sample of a station at a distance, linear."""
        return np.asarray(power_mw * self._amplitude(distance_m) ** 2 / self.noise_mw)

    def _amplitude(self, distance_m: FloatArray) -> FloatArray:
        """Gain of an amplitude at a distance."""
        near = np.maximum(distance_m, _LEAST_M)
        exponent = 0.5 * self.description.path_loss_exponent
        return np.asarray(10.0 ** (self._at_1m_db / -20.0) * near**-exponent)

    def _ways(self, state: FloatArray) -> FloatArray:
        """Ways [train, 8] as of `path_kernel.distances`."""
        columns = ("x_m", "y_m", "z_m", "heading_rad", "speed_mps", "acceleration_mps2")
        ways = np.zeros((len(state), 8))
        ways[:, :6] = state[:, [STATE.index[column] for column in columns]]
        on, chainage_m = state[:, STATE.index["track_index"]], state[:, STATE.index["chainage_m"]]
        for index in set(on.tolist()):
            track, rows = self._tracks[int(index)], on == index
            at_m = np.minimum(np.maximum(chainage_m[rows], 0.0), track.length_m)
            ways[rows, 6] = track.curvature_per_m(at_m)
            ways[rows, 7] = 1e-3 * track.gradient_permil(at_m)
        return ways

    def _add(
        self,
        sent: Mapping[int, ComplexArray],
        station: NDArray[np.intp],
        row: NDArray[np.intp],
        offset_hz: FloatArray,
        distance_m: FloatArray,
        heard: NDArray[np.complex64],
    ) -> None:
        """Add what arrives over links [link] to the rows of ``heard`` [row, sample]."""
        indices = station.tolist()
        tones = {index: self._sent(index, sent[index]) for index in set(indices)}
        turns = np.zeros((len(indices), 4))
        turns[:, 0] = offset_hz
        turns[:, 1] = self.description.carrier_hz / SPEED_OF_LIGHT_M_PER_S
        turns[:, 2] = [tones[index].mean_hz / SPEED_OF_LIGHT_M_PER_S for index in indices]
        lines = {index: number for number, index in enumerate(tones) if tones[index].line}
        envelopes = [tone.samples for tone in tones.values()]
        source = np.array([lines.get(index, -1) for index in indices], dtype=np.int64)
        others = np.flatnonzero(source < 0)
        if others.size:
            turns[others, 3] = middle_m = distance_m[others, self.description.samples // 2]
            source[others] = len(envelopes) + np.arange(others.size)
            spectra = np.array([tones[indices[link]].spectrum for link in others.tolist()])
            delay_s = middle_m / SPEED_OF_LIGHT_M_PER_S
            envelopes.extend(delayed(spectra, delay_s, self.description.sample_rate_hz))
        add_tones(
            *(row, source, turns, self._time_s, distance_m, self._amplitude(distance_m)),
            np.array(envelopes).view(np.float64),
            heard.view(np.float32),
        )

    def _sent(self, station: int, samples: ComplexArray) -> _TransmittedTone:
        known = self._known.get(station)
        if known is None or known.samples is not samples:
            if samples.shape != (self.description.samples,):
                raise ValueError(
                    f"a block of {samples.shape}, not of {self.description.samples} samples"
                )
            spectrum = np.fft.fft(samples)
            power = np.abs(spectrum) ** 2
            total = float(power.sum())
            mean_hz = float(power @ self._frequencies_hz) / total if total else 0.0
            power[power.argmax()] = 0.0
            line = bool(power.sum() < _NO_OTHER_LINE * total)
            known = self._known[station] = _TransmittedTone(samples, spectrum, mean_hz, line)
        return known
