"""The rails as a medium: from the transmitters of track circuits to antennas and receivers.

A circuit's transmitter stands at its exit end, its receiver at its entry end. Between a
transmitter at ``e`` and a listener at ``x`` of the same track, in decibels,

    loss = attenuation |e - x| + joint * (joints between) + shunt * (trains between)

A train's antenna is ahead of its first axle: its own axles lie between it and all that is
behind. ``broken_rail`` adds its loss to the paths that pass the break, ``sanding`` to all that
the train hears from the rails. ``failed_joint`` takes the loss of a joint away but for what is
left, ``poor_shunt`` that of the axles of one train; ``wet_ballast`` attenuates more on its stretch
(`rail_world.track_code.line_constants`).

| symbol | meaning | unit |
|---|---|---|
| g0, g1 | gain of a path at the begin and at the end of the tick | 1 |
| i, n | sample, samples in a tick | 1 |

A sample is carried with the gain ``g0 + (g1 - g0) i / n``. The end of a tick is the begin of the
next, so no gain jumps at the border. The delay (3 µs/km) is nothing at audio frequencies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from rail_signals.arrays import BoolArray, FloatArray
from rail_world.line.description_base import whole_samples

from .description import RailDescription, RailFault
from .line_constants import attenuation_db_per_km, shunt_loss_db
from .noise import RealNoiseSource

IntArray = NDArray[np.intp]

# Circuits that a listener hears, counted along the track from its own. The second one ahead has
# the listener's own carrier again; all others are another joint, and some 40 dB, weaker.
_NEIGHBOURS = np.array([-1, 0, 1, 2])
# Farther apart than any two chainages: makes one sorted axis of all tracks.
_TRACK_APART_M = 4e6
_ANTENNA_NOISE, _RECEIVER_NOISE, _ANTENNA_IMPULSES, _RECEIVER_IMPULSES = 1, 2, 3, 4


@dataclass(frozen=True)
class TrainsOnRails:
    """Where the trains are: arrays over the trains in the order of the description.

    Parameters
    ----------
    track : int array [train]
        Index of the front's track in the description's order of tracks.
    front_m, rear_m : array [train]
        Chainage of the antenna (at the first axle) and of the last axle [m].
    on_line : bool array [train]
        Whether the train is on the line at all.
    rear_track : int array [train], optional
        Track of the rear, if that is still on another one: the train then fills that track
        from ``rear_m`` on, and the front's track up to ``front_m``.

    Raises
    ------
    ValueError
        If the arrays do not agree in shape.
    """

    track: IntArray
    front_m: FloatArray
    rear_m: FloatArray
    on_line: BoolArray
    rear_track: IntArray | None = None

    def __post_init__(self) -> None:
        shape = self.front_m.shape
        arrays = (self.track, self.rear_m, self.on_line, self.rear_track)
        if len(shape) != 1 or any(a is not None and a.shape != shape for a in arrays):
            raise ValueError(f"trains: arrays that do not agree with front_m {shape}")


@dataclass(frozen=True)
class RailReception:
    """What arrives in one tick [V].

    ``trains`` [train, sample] at the antennas and ``circuits`` [circuit, sample] at the
    receivers, both in the order of the description.
    """

    trains: FloatArray
    circuits: FloatArray


@dataclass(frozen=True)
class LinkGains:
    """Gains at one moment from transmitters to listeners: the trains, then the circuits.

    ``source`` [listener, path] circuit index, ``gain`` [listener, path] amplitude ratio [1],
    zero where there is no path.
    """

    source: IntArray
    gain: FloatArray


class RailMedium:
    """Propagates the blocks of one tick.

    Parameters
    ----------
    description : RailDescription
    seed : int
        Of the noise and of the phases of the harmonics.
    tick_s : float
        Length of a tick [s].

    Raises
    ------
    ValueError
        If a tick is not a whole number of samples.
    """

    def __init__(self, description: RailDescription, seed: int, tick_s: float = 0.1) -> None:
        self.description = description
        self.samples = samples = whole_samples(description.sample_rate_hz, tick_s)
        circuits = description.circuits
        tracks = {name: index for index, name in enumerate(description.track_order)}
        track = np.array([tracks[circuit.track] for circuit in circuits], dtype=np.intp)
        start_m = np.array([circuit.start_m for circuit in circuits])
        # Internally the circuits stand in the order of tracks and chainages.
        self._order = np.lexsort((start_m, track))
        self._place = np.argsort(self._order)
        self._track = track[self._order]
        self._start_m = start_m[self._order]
        self._end_m = np.array([circuit.end_m for circuit in circuits])[self._order]
        self._carrier_hz = np.array([c.carrier_hz for c in circuits])[self._order]
        self._key_m = self._track * _TRACK_APART_M + self._start_m
        self._index = {circuit.name: index for index, circuit in enumerate(circuits)}
        self._train = {name: index for index, name in enumerate(description.trains)}
        self._ramp = np.arange(samples) / samples
        self._noise = RealNoiseSource(seed, samples)
        # Tick, gains and pick-up of the last block: a tick begins as the one before it ended.
        self._last: tuple[int, LinkGains, FloatArray] | None = None
        harmonics = description.harmonics
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 5])))
        self._harmonic_turns = rng.random(len(harmonics))
        self._harmonic_v = np.array([harmonic.amplitude_v for harmonic in harmonics])
        orders = np.array([harmonic.order for harmonic in harmonics], dtype=np.float64)
        self._harmonic_step = orders * description.fundamental_hz / description.sample_rate_hz

    def propagate(
        self,
        tick: int,
        time_s: float,
        trains: TrainsOnRails,
        blocks: Mapping[int, FloatArray],
    ) -> RailReception:
        """What every antenna and every receiver hears.

        Parameters
        ----------
        tick, time_s : int, float
            Number of the tick and simulated time of its end [s].
        trains : TrainsOnRails
            At the end of the tick. They begin where they were at the end of the tick before;
            without that one (at the start, after a gap or a jump in time) they stand.
        blocks : mapping
            Index of the circuit -> samples [sample] sent by its transmitter; silent ones are
            missing.

        Raises
        ------
        ValueError
            If a block has a wrong length, or the trains a wrong number.
        """
        rails, samples = self.description, self.samples
        count, circuits = len(rails.trains), len(rails.circuits)
        for circuit, block in blocks.items():
            if np.shape(block) != (samples,):
                raise ValueError(f"circuit {circuit}: {np.shape(block)} samples, not {samples}")
        end, end_left = self.gains(trains, time_s), self._sanding(time_s)
        start, start_left = end, end_left
        if self._last is not None and self._last[0] == tick - 1:
            _, start, start_left = self._last
        self._last = (tick, end, end_left)
        arrived = np.zeros((count + circuits, samples))
        if blocks:
            sending = sorted(blocks)
            sent = np.array([blocks[circuit] for circuit in sending], dtype=np.float64)
            sent *= rails.transmit_level_v
            row_of = np.full(circuits, -1, dtype=np.intp)
            row_of[sending] = np.arange(len(sending))
            # A product of a sparse matrix adds row by row: no listener depends on the others.
            steady = _matrix(start, row_of, len(sending))
            change = _matrix(end, row_of, len(sending)) - steady
            change.eliminate_zeros()
            arrived += steady @ sent
            if change.nnz:
                arrived += change @ (sent * self._ramp)
        if len(self._harmonic_v):
            harmonics = self._harmonics(tick)
            left = start_left[:, None] + (end_left - start_left)[:, None] * self._ramp
            arrived[:count] += left * harmonics
            arrived[count:] += harmonics
        antennas, receivers = arrived[:count], arrived[count:]
        self._add_noise(antennas, _ANTENNA_NOISE, _ANTENNA_IMPULSES, tick)
        self._add_noise(receivers, _RECEIVER_NOISE, _RECEIVER_IMPULSES, tick)
        return RailReception(antennas, receivers)

    def gains(self, trains: TrainsOnRails, time_s: float) -> LinkGains:
        """Gains of all paths with the trains at ``trains`` and the faults of ``time_s``."""
        rails = self.description
        count = len(rails.trains)
        if len(trains.front_m) != count:
            raise ValueError(f"{len(trains.front_m)} trains, not {count}")
        # Listeners: the antennas, then the receivers in the order of the description.
        own = np.concatenate((self._sorted_circuit(trains), self._place))
        x_m = np.concatenate((trains.front_m, self._start_m[self._place]))[:, None]
        source = own[:, None] + _NEIGHBOURS
        known = (own[:, None] >= 0) & (source >= 0) & (source < len(self._order))
        source = np.where(known, source, 0)
        known &= self._track[source] == self._track[own][:, None]
        from_m = self._end_m[source]
        low_m, high_m = np.minimum(x_m, from_m), np.maximum(x_m, from_m)
        loss_db = rails.attenuation_db_per_km * 1e-3 * (high_m - low_m)
        loss_db += rails.joint_attenuation_db * np.abs(_NEIGHBOURS)
        carrier_hz = self._carrier_hz[source]
        between = self._trains_between(trains, self._track[own], low_m, high_m)
        shunts = self._shunts_db(time_s)
        if shunts is None:
            loss_db += rails.shunt_attenuation_db * np.count_nonzero(between, axis=-1)
        else:
            loss_db += between @ shunts
        circuit = self._order[source]
        for fault in rails.faults:
            if not fault.from_s <= time_s < fault.to_s:
                continue
            if fault.kind == "dead_transmitter":
                known &= circuit != self._index[str(fault.circuit)]
            elif fault.kind == "failed_joint":
                at = self._place[self._index[str(fault.circuit)]]
                passes = (np.minimum(own[:, None], source) <= at) & (
                    at < np.maximum(own[:, None], source)
                )
                gain_db = rails.joint_attenuation_db - float(fault.loss_db or 0.0)
                loss_db -= np.where(passes, max(0.0, gain_db), 0.0)
            elif fault.kind == "wet_ballast":
                loss_db += self._wet_db(fault, own, low_m, high_m, carrier_hz)
            elif fault.kind == "broken_rail" and fault.loss_db is not None:
                at = self._place[self._index[str(fault.circuit)]]
                middle_m = 0.5 * float(self._start_m[at] + self._end_m[at])
                break_m = middle_m if fault.at_m is None else fault.at_m
                passes = (low_m <= break_m) & (break_m < high_m)
                passes &= (self._track[own] == self._track[at])[:, None]
                loss_db += np.where(passes, fault.loss_db, 0.0)
        gain = np.where(known, 10.0 ** (loss_db / -20.0), 0.0)
        gain[:count] *= self._sanding(time_s)[:, None]
        return LinkGains(circuit, gain)

    def circuit_of(self, trains: TrainsOnRails) -> IntArray:
        """Index of the circuit that each train's antenna is in [train], -1 = none."""
        at = self._sorted_circuit(trains)
        return np.where(at >= 0, self._order[at], -1)

    def _sorted_circuit(self, trains: TrainsOnRails) -> IntArray:
        """The circuit of each antenna in the internal order [train], -1 = none."""
        key_m = trains.track * _TRACK_APART_M + trains.front_m
        at = np.searchsorted(self._key_m, key_m, side="right") - 1
        inside = (at >= 0) & trains.on_line & (self._track[at] == trains.track)
        inside &= trains.front_m < self._end_m[at]
        return np.where(inside, at, -1)

    @staticmethod
    def _trains_between(
        trains: TrainsOnRails, track: IntArray, low_m: FloatArray, high_m: FloatArray
    ) -> BoolArray:
        """Trains [listener, path, train] with axles between ``low_m`` and ``high_m``."""
        on = track[:, None, None]
        low, high = low_m[..., None], high_m[..., None]
        if trains.rear_track is None:
            whole, tail = np.True_, np.False_
        else:
            whole = trains.track == trains.rear_track
            tail = (trains.rear_track == on) & ~whole & (trains.rear_m < high)
        # A train on two tracks fills the front's one from its start, the rear's to its end.
        rear_m = np.where(whole, trains.rear_m, -math.inf)
        axles = (trains.track == on) & (trains.front_m > low) & (rear_m < high)
        axles = np.asarray((axles | tail) & trains.on_line)
        return axles

    def _shunts_db(self, time_s: float) -> FloatArray | None:
        """Loss past each train [train], None if all shunt as they should."""
        rails = self.description
        poor = [
            fault
            for fault in rails.faults
            if fault.kind == "poor_shunt" and fault.from_s <= time_s < fault.to_s
        ]
        if not poor:
            return None
        shunts = np.full(len(rails.trains), rails.shunt_attenuation_db)
        for fault in poor:
            loss_db = shunt_loss_db(
                fault.shunt_ohm or math.inf,
                rails.attenuation_db_per_km,
                float(self._carrier_hz.mean()),
            )
            at = self._train[str(fault.train)]
            shunts[at] = min(shunts[at], loss_db)
        return shunts

    def _wet_db(
        self,
        fault: RailFault,
        own: IntArray,
        low_m: FloatArray,
        high_m: FloatArray,
        carrier_hz: FloatArray,
    ) -> FloatArray:
        """What paths [listener, path] lose more on a wet stretch."""
        begin_m = fault.from_m or 0.0
        end_m = math.inf if fault.to_m is None else fault.to_m
        wet_m = np.minimum(high_m, end_m) - np.maximum(low_m, begin_m)
        on_track = self._track[own] == self.description.track_order.index(str(fault.track))
        wet_m = np.where(on_track[:, None], np.maximum(wet_m, 0.0), 0.0)
        # The attenuation goes with the root of the frequency.
        per_km = attenuation_db_per_km(fault.ballast_ohm_km or math.inf, 1.0) * np.sqrt(carrier_hz)
        more = np.maximum(per_km - self.description.attenuation_db_per_km, 0.0)
        lost: FloatArray = 1e-3 * more * wet_m
        return lost

    def _sanding(self, time_s: float) -> FloatArray:
        """What sand between wheels and rails leaves of the signal [train]."""
        left = np.ones(len(self._train))
        for fault in self.description.faults:
            if fault.kind != "sanding" or fault.loss_db is None:
                continue
            if fault.from_s <= time_s < fault.to_s:
                left[self._train[str(fault.train)]] *= 10.0 ** (fault.loss_db / -20.0)
        return left

    def _harmonics(self, tick: int) -> FloatArray:
        """Harmonics of the traction current [sample], continuous over ticks [V]."""
        # The turns before the tick are taken out whole: few are left to lose digits on.
        start = np.mod(self._harmonic_step * (tick * self.samples) + self._harmonic_turns, 1.0)
        turns = start[:, None] + self._harmonic_step[:, None] * np.arange(self.samples)
        total: FloatArray = np.einsum("h,hs->s", self._harmonic_v, np.cos(2.0 * np.pi * turns))
        return total

    def _add_noise(self, arrived: FloatArray, noise: int, impulses: int, tick: int) -> None:
        """Add white noise and impulses to ``arrived`` [port, sample] in place."""
        rails = self.description
        ports = range(len(arrived))
        if rails.white_noise_v > 0.0:
            arrived += rails.white_noise_v * self._noise.blocks(noise, ports, tick)
        mean = rails.impulse_rate_per_s * self.samples / rails.sample_rate_hz
        if mean > 0.0 and rails.impulse_amplitude_v > 0.0:
            row, sample, height = self._noise.impulses(impulses, ports, tick, mean)
            np.add.at(arrived, (row, sample), rails.impulse_amplitude_v * height)


def _matrix(links: LinkGains, row_of: IntArray, sending: int) -> csr_array:
    """Gains as a sparse matrix [listener, sender], silent circuits left out."""
    sender = row_of[links.source]
    listener, path = np.nonzero((links.gain > 0.0) & (sender >= 0))
    shape = (len(links.gain), sending)
    return csr_array((links.gain[listener, path], (listener, sender[listener, path])), shape=shape)
