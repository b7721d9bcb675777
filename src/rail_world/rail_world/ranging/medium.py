"""The radio medium: everything between a transmitting and a receiving antenna.

Free-space loss at 1 m, then the path-loss exponent; parabolic antenna patterns; the exact
fractional delay of the envelope and the carrier phase of the same path; Doppler shift and
oscillator offsets; the sum of all transmitters in reach on the channel; thermal noise.

No station reaches past two zones (Jeong et al., section 2.5): beyond ``coverage_range_m`` of a
station antenna a link does not exist, in either direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.delay import repetition

from .description import AntennaPattern, RadioDescription
from .noise import NoiseSource
from .path_kernels import add_links, carry, links_in_coverage

THERMAL_NOISE_DBM_PER_HZ = -173.975  # k T at 290 K
_MIN_DISTANCE_M = 1.0


@dataclass(frozen=True)
class TrainAntennas:
    """Where the train antennas are: arrays over the trains in the order of the description.

    ``position_m`` and ``velocity_mps`` [train, 3]; ``heading_rad`` [train] of the track
    towards increasing chainage, anticlockwise from east.
    """

    position_m: FloatArray
    velocity_mps: FloatArray
    heading_rad: FloatArray


@dataclass(frozen=True)
class Paths:
    """Geometry of one tick between all station and train antennas, arrays [station, train].

    Out of coverage the gain is -inf, the closing speed 0. ``links`` counts those in coverage.
    """

    distance_m: FloatArray
    closing_speed_mps: FloatArray
    gain_db: FloatArray
    in_coverage: NDArray[np.bool_]
    train_position_m: FloatArray
    train_axis: FloatArray
    links: int


@dataclass(frozen=True)
class _TransmittedBlock:
    """A block that an antenna sends, its mean power and the transform of its period."""

    samples: ComplexArray
    power_mw: float
    spectrum: ComplexArray


@dataclass(frozen=True)
class Reception:
    """What one antenna receives on one channel.

    ``samples`` in sqrt(mW); ``signal_mw`` of the strongest source, which is the pair
    ``source`` (station antenna, train); ``noise_mw`` of thermal noise and jammers.
    """

    samples: NDArray[np.complex64]
    signal_mw: float
    noise_mw: float
    source: tuple[int, int]

    @property
    def snr(self) -> float:
        """Carrier-to-noise ratio per sample, linear."""
        return self.signal_mw / self.noise_mw


def pattern_gain_db(pattern: AntennaPattern, cos_angle: FloatArray) -> FloatArray:
    """Gain off the axis: ``G - min(12 (angle / beamwidth)^2, front-to-back)``."""
    angle_deg = np.degrees(np.arccos(np.clip(cos_angle, -1.0, 1.0)))
    roll_off_db = 12.0 * (angle_deg / pattern.beamwidth_deg) ** 2
    return pattern.gain_dbi - np.minimum(roll_off_db, pattern.front_to_back_db)


class RadioMedium:
    """Propagates the blocks of one tick.

    Parameters
    ----------
    description : RadioDescription
    seed : int
        Of the noise and the oscillators.
    """

    def __init__(self, description: RadioDescription, seed: int) -> None:
        self.description = description
        stations = description.stations
        self._positions_m = np.array([a.position_m for a in stations]).reshape(-1, 3)
        boresight = np.array([a.boresight for a in stations]).reshape(-1, 3)
        self._boresight = boresight / np.linalg.norm(boresight, axis=1, keepdims=True)
        coverage_range_m = np.array([a.coverage_range_m for a in stations])
        self._antennas = np.column_stack((self._positions_m, self._boresight, coverage_range_m))
        ours, theirs = description.station_pattern, description.train_pattern
        self._patterns = (
            ours.gain_dbi + theirs.gain_dbi,
            *(ours.beamwidth_deg, ours.front_to_back_db),
            *(theirs.beamwidth_deg, theirs.front_to_back_db),
        )
        self._downlink = np.array([a.downlink_channel for a in stations], dtype=np.int64)
        self._uplink = np.array([a.uplink_channel for a in stations], dtype=np.int64)
        self._sites = [a.site for a in stations]
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 0])))
        sigma = description.oscillator_ppm * 1e-6
        # A site has one oscillator for all its antennas.
        by_site = {site: sigma * rng.standard_normal() for site in dict.fromkeys(self._sites)}
        self._station_offset = np.array([by_site[site] for site in self._sites])
        self._train_offset = sigma * rng.standard_normal(len(description.trains))
        # By channel number, so that arrays of channels can index them.
        self._carrier_hz = np.zeros(1 + max(description.carriers_hz, default=0))
        for channel, carrier_hz in description.carriers_hz.items():
            self._carrier_hz[channel] = carrier_hz
        with np.errstate(divide="ignore"):
            self._loss_at_1m_db = 20.0 * np.log10(
                4.0 * np.pi * self._carrier_hz / SPEED_OF_LIGHT_M_PER_S
            )
        self.noise_mw = 10.0 ** (
            (THERMAL_NOISE_DBM_PER_HZ + description.noise_figure_db) / 10.0
        ) * (description.sample_rate_hz)
        self._floor_mw = self.noise_mw * 10.0 ** (description.sensitivity_db / 10.0)
        self._noise = NoiseSource(seed, description.samples)
        self._known: dict[tuple[bool, int], _TransmittedBlock] = {}

    def paths(self, trains: TrainAntennas) -> Paths:
        """Distances, closing speeds and antenna gains of one tick."""
        # The train's antenna looks back to the station of its zone.
        heading = trains.heading_rad
        axis = -np.stack((np.cos(heading), np.sin(heading), np.zeros_like(heading)), axis=1)
        shape = (len(self._sites), len(heading))
        links, in_coverage = np.empty((3, *shape)), np.empty(shape, dtype=np.bool_)
        count = links_in_coverage(
            self._antennas,
            np.concatenate((trains.position_m, axis, trains.velocity_mps), axis=1),
            self._patterns,
            *(self.description.path_loss_exponent, _MIN_DISTANCE_M),
            *(links, in_coverage),
        )
        distance_m, closing_mps, gain_db = links
        return Paths(distance_m, closing_mps, gain_db, in_coverage, trains.position_m, axis, count)

    def dead_stations(self, time_s: float) -> set[int]:
        """Indices of station antennas that are dead at ``time_s``."""
        return {
            index
            for fault in self.description.faults
            if fault.kind == "dead_station" and fault.from_s <= time_s < fault.to_s
            for index, site in enumerate(self._sites)
            if site == fault.station
        }

    def downlink(
        self, tick: int, time_s: float, paths: Paths, blocks: dict[int, ComplexArray]
    ) -> dict[tuple[int, int], Reception]:
        """What each train hears on each channel.

        Parameters
        ----------
        tick, time_s : int, float
            Number and simulated time of the tick.
        paths : Paths
        blocks : dict
            Index of the station antenna -> samples sent, sqrt(mW); silent ones are missing.
            An array that is passed again is taken to hold the same samples.

        Returns
        -------
        dict of (train index, channel) -> Reception; pairs that hear nothing are missing.
        """
        return self._receive(tick, time_s, paths, blocks, self._downlink)

    def uplink(
        self,
        tick: int,
        time_s: float,
        paths: Paths,
        blocks: dict[int, tuple[int, ComplexArray]],
    ) -> dict[tuple[int, int], Reception]:
        """What each station antenna hears on its uplink channel.

        ``blocks``: train index -> (channel, samples sent).
        Returns a dict of (station antenna index, channel) -> Reception.
        """
        channel = np.zeros(paths.in_coverage.shape[1], dtype=np.int64)
        for train, (on, _) in blocks.items():
            channel[train] = on
        sent = {train: samples for train, (_, samples) in blocks.items()}
        return self._receive(tick, time_s, paths, sent, channel, uplink=True)

    def _alive(self, time_s: float) -> NDArray[np.bool_]:
        """Which station antennas are not dead."""
        alive = np.ones(len(self._sites), dtype=np.bool_)
        alive[list(self.dead_stations(time_s))] = False
        return alive

    def _receive(
        self,
        tick: int,
        time_s: float,
        paths: Paths,
        blocks: dict[int, ComplexArray],
        channel: NDArray[np.int64],
        *,
        uplink: bool = False,
    ) -> dict[tuple[int, int], Reception]:
        """Carry ``blocks`` of senders, each on its ``channel`` [sender], and add noise."""
        # Of a long line all stations send, and few have a train in reach.
        reach = np.flatnonzero(paths.in_coverage.any(axis=0 if uplink else 1)).tolist()
        senders = [sender for sender in reach if sender in blocks]
        if not senders:
            return {}
        radio = self.description
        sent = [self._sent(uplink, sender, blocks[sender]) for sender in senders]
        row_of = np.full(len(channel), -1)
        row_of[senders] = range(len(sent))
        spectra, periods = _side_by_side([block.spectrum for block in sent])
        table = np.empty((paths.links, 5), dtype=np.int64)
        values = np.empty((paths.links, 2))
        arrived = np.empty((paths.links, spectra.shape[1]), dtype=np.complex128)
        count, _ = carry(
            uplink,
            (row_of, channel, periods, np.array([block.power_mw for block in sent]), spectra),
            (
                self._uplink if uplink else self._downlink,
                *(self._alive(time_s), self._station_offset),
            ),
            self._train_offset,
            (self._carrier_hz, self._loss_at_1m_db),
            (paths.in_coverage, paths.distance_m, paths.closing_speed_mps, paths.gain_db),
            (self._floor_mw, SPEED_OF_LIGHT_M_PER_S, radio.sample_rate_hz),
            (table, values, arrived),
        )
        if not count:
            return {}
        table, values, arrived = table[:count], values[:count], arrived[:count]
        # In double precision, where a row does not depend on the others that are transformed.
        for period in set(periods.tolist()):
            rows = table[:, 3] == period
            arrived[rows, :period] = np.fft.ifft(arrived[rows, :period])
        # Of each port the strongest link, in the order of the ports.
        links = table[table[:, 4] == 1]
        power_mw = values[table[:, 4] == 1, 0].tolist()
        order = np.argsort(links[:, 0]).tolist()
        sources = links[:, 1:3].tolist()
        numbers = self._uplink if uplink else self._downlink
        ports = [
            (source[0 if uplink else 1], int(numbers[source[0]]))
            for source in (sources[link] for link in order)
        ]
        noise_mw = [
            self.noise_mw + self._jamming_mw(time_s, port, paths, uplink=uplink) for port in ports
        ]
        places = [port[0] * 128 + port[1] for port in ports]
        heard = self._noise.blocks(2 if uplink else 1, places, tick, np.array(noise_mw))
        add_links(table, values, arrived.view(np.float64), heard.view(np.float32))
        return {
            port: Reception(samples, power_mw[link], noise, (sources[link][0], sources[link][1]))
            for port, samples, noise, link in zip(ports, heard, noise_mw, order, strict=True)
        }

    def _sent(self, uplink: bool, sender: int, samples: ComplexArray) -> _TransmittedBlock:
        """Power and spectrum of a block; a block that is sent again is not transformed again."""
        known = self._known.get((uplink, sender))
        if known is None or known.samples is not samples:
            if len(samples) != self.description.samples:
                raise ValueError(
                    f"a block of {len(samples)} samples, not {self.description.samples}"
                )
            period = repetition(samples, len(known.spectrum) if known else 0)
            one = samples[:period]
            power_mw = float(np.vdot(one, one).real) / period
            known = _TransmittedBlock(samples, power_mw, np.fft.fft(one))
            self._known[uplink, sender] = known
        return known

    def _jamming_mw(
        self, time_s: float, port: tuple[int, int], paths: Paths, *, uplink: bool
    ) -> float:
        """Noise power that the jammers on the channel bring into a receiving antenna."""
        radio = self.description
        total = 0.0
        for fault in radio.faults:
            if fault.power_dbm is None or not fault.from_s <= time_s < fault.to_s:
                continue  # a dead station has no power
            if fault.channel != port[1]:
                continue
            if uplink:
                here, axis = self._positions_m[port[0]], self._boresight[port[0]]
                pattern = radio.station_pattern
            else:
                here, axis = paths.train_position_m[port[0]], paths.train_axis[port[0]]
                pattern = radio.train_pattern
            line = np.asarray(fault.position_m) - here
            distance_m = max(float(np.sqrt(line @ line)), _MIN_DISTANCE_M)
            gain_db = float(pattern_gain_db(pattern, line @ axis / distance_m))
            loss_db = float(self._loss_at_1m_db[port[1]]) + 10.0 * (
                radio.path_loss_exponent * np.log10(distance_m)
            )
            total += 10.0 ** ((fault.power_dbm + gain_db - loss_db) / 10.0)
        return total


def _side_by_side(spectra: list[ComplexArray]) -> tuple[ComplexArray, NDArray[np.int64]]:
    """Transforms [sender, longest period] of one period each, and the periods [sender]."""
    periods = np.array([len(spectrum) for spectrum in spectra])
    rows = np.empty((len(spectra), int(periods.max())), dtype=np.complex128)
    for row, spectrum in zip(rows, spectra, strict=True):
        row[: len(spectrum)] = spectrum
    return rows, periods
