"""The CBTC radio medium: time-varying MIMO channels between the masts and the trains.

A train hears, on each channel and with each antenna r,

    y_r(t) = sum_b g_b(t) sum_a h_{b,r,a}(t) x_{b,a}(t) + w_r(t)

over the base stations b in reach; a base station hears the trains alike. Samples are in sqrt(mW):
``|x|^2`` summed over the antennas is the radiated power.

======= ===================================================================================
g       sqrt of the power gain: path loss, cuttings and tunnels, offset; runs straight in t
        from the start to the end of a tick, where the next one begins
h       fading of unit mean power along the way of the train, `rail_world.train_radio.fading`
w       white Gaussian noise of k T F times the sample rate, single precision
======= ===================================================================================

Only what is sent is carried, and only where somebody listens: senders hand over bursts,
receivers name windows.

Left out: delay (3.3 us/km; the radios advance their timing), errors of oscillators.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_world.line.description_base import whole_samples
from rail_world.ranging.medium import THERMAL_NOISE_DBM_PER_HZ
from rail_world.ranging.noise import NoiseSource

from .description import CbtcDescription
from .fading import LinkFading
from .links import DOWNLINK, UPLINK, LinkGeometry, Links

__all__ = ["Burst", "CbtcMedium", "Links"]

_FADING_STREAM = 7
_STAGE = (11, 12)  # of the noise; the ranging radio has 1 and 2 of the same stream
_NOISE_SAMPLES = 256
_MOST_NOISE_BLOCKS = 1 << 24
_MOST_CHANNELS = 128
_PIECE_SAMPLES = 2048

_Key = TypeVar("_Key", int, tuple[int, int])


@dataclass(frozen=True, eq=False)
class Burst:
    """Samples of all antennas of one radio from sample ``start`` of a tick on.

    ``samples`` complex [antenna, sample], sqrt(mW). A sender is silent outside its bursts.
    """

    start: int
    samples: NDArray[np.complexfloating]

    @property
    def stop(self) -> int:
        """The sample after its last."""
        return self.start + int(self.samples.shape[1])


@dataclass(frozen=True)
class _Port:
    """A receiver on a channel in one tick: what it looks at, the links (base, train) it hears."""

    number: int
    noise_mw: float
    windows: Sequence[tuple[int, int]]
    sources: tuple[tuple[int, int, Sequence[Burst]], ...]


class CbtcMedium:
    """Propagates the bursts of one tick.

    Fading depends on nothing but (seed, base, train, direction) and the way of the train, noise
    on nothing but (seed, direction, receiver, channel, tick, sample).

    Parameters
    ----------
    description : CbtcDescription
    seed : int
        Of the fading and the noise.
    tick_s : float
        Length of a tick [s].

    Raises
    ------
    ValueError
        If a tick is not a whole number of samples.
    """

    def __init__(self, description: CbtcDescription, seed: int, tick_s: float = 0.1) -> None:
        self.description = description
        self.samples = whole_samples(description.sample_rate_hz, tick_s)
        self._seed = seed
        self._geometry = LinkGeometry(description, tick_s)
        self._channel = [mast.channel for mast in description.base_stations]
        base, train = description.base_antennas, description.train_antennas
        self._antennas = ((train, base), (base, train))  # [direction] of (receiver, sender)
        figure_db = THERMAL_NOISE_DBM_PER_HZ + description.noise_figure_db
        self.noise_mw: float = 10.0 ** (figure_db / 10.0) * description.sample_rate_hz
        self._noise = [NoiseSource(seed, rx * _NOISE_SAMPLES) for rx, _ in self._antennas]
        self._fading: dict[tuple[int, int, int], LinkFading] = {}

    def links(self, tick: int, time_s: float, state: FloatArray) -> Links:
        """Geometry and gains of all links.

        Parameters
        ----------
        tick, time_s : int, float
            Number of the tick and simulated time of its end [s].
        state : array [train, column]
            The truth at the end of the tick, columns as `STATE.columns`; the
            acceleration is the mean of the tick.

        Raises
        ------
        ValueError
            If the table has a wrong shape.
        """
        return self._geometry.links(tick, time_s, state)

    def snr(
        self, links: Links, *, uplink: bool = False, power_dbm: float | None = None
    ) -> FloatArray:
        """Mean signal-to-noise ratio of a sample at one receive antenna [base, train], linear.

        At the end of the tick; 0 out of reach or with a dead base station. Of a pulse of unit
        energy, Es/N0 of a symbol is this times the samples per symbol.

        Parameters
        ----------
        links : Links
        uplink : bool
            From the trains to the masts.
        power_dbm : float, optional
            Mean power of all antennas of the sender; the description's if not said.
        """
        radio = self.description
        if power_dbm is None:
            power_dbm = radio.train_power_dbm if uplink else radio.base_power_dbm
        gain_db = links.gain_db[UPLINK if uplink else DOWNLINK, 1]
        noise_mw = np.array([self._noise_mw(links, channel) for channel in self._channel])
        hears = links.in_coverage & self._alive(links)[:, None]
        ratio = 10.0 ** ((power_dbm + gain_db) / 10.0) / noise_mw[:, None]
        return np.where(hears, ratio, 0.0)

    def downlink(
        self,
        links: Links,
        sent: Mapping[int, Sequence[Burst]],
        windows: Mapping[tuple[int, int], Sequence[tuple[int, int]]],
    ) -> dict[tuple[int, int], tuple[Burst, ...]]:
        """What the trains hear.

        Parameters
        ----------
        links : Links
        sent : mapping
            Base station -> bursts it sends; silent ones are missing.
        windows : mapping
            (train, channel) -> the spans [start, stop) of samples that the train listens to.

        Returns
        -------
        (train, channel) -> one burst complex64 [rx, sample] per window, signals and noise; missing
        if the train has no base station on the channel in reach, dead ones counted.

        Raises
        ------
        ValueError
            If a burst or a window does not fit the tick or the antennas.
        """
        alive = self._alive(links)
        ports: dict[tuple[int, int], _Port] = {}
        for (train, channel), spans in windows.items():
            near = [
                base
                for base in np.flatnonzero(links.in_coverage[:, train]).tolist()
                if self._channel[base] == channel
            ]
            if near:
                received = [base for base in near if alive[base] and base in sent]
                ports[train, channel] = _Port(
                    train * _MOST_CHANNELS + channel,
                    self._noise_mw(links, channel),
                    spans,
                    tuple((base, train, sent[base]) for base in received),
                )
        return self._receive(links, DOWNLINK, ports)

    def uplink(
        self,
        links: Links,
        sent: Mapping[int, tuple[int, Sequence[Burst]]],
        windows: Mapping[int, Sequence[tuple[int, int]]],
    ) -> dict[int, tuple[Burst, ...]]:
        """What the base stations hear, each on its channel.

        As `downlink`, with ``sent`` train -> (channel, bursts) and ``windows`` base station ->
        spans. Missing are base stations that are dead or have no train in reach.
        """
        alive = self._alive(links)
        ports: dict[int, _Port] = {}
        for base, spans in windows.items():
            near = np.flatnonzero(links.in_coverage[base]).tolist()
            if near and alive[base]:
                channel = self._channel[base]
                received = [train for train in near if train in sent and sent[train][0] == channel]
                ports[base] = _Port(
                    base * _MOST_CHANNELS + channel,
                    self._noise_mw(links, channel),
                    spans,
                    tuple((base, train, sent[train][1]) for train in received),
                )
        return self._receive(links, UPLINK, ports)

    def _receive(
        self, links: Links, direction: int, ports: Mapping[_Key, _Port]
    ) -> dict[_Key, tuple[Burst, ...]]:
        """Noise in all windows of all ports, and what their sources bring into them."""
        for port in ports.values():
            for start, stop in port.windows:
                if not 0 <= start < stop <= self.samples:
                    raise ValueError(f"window {start, stop} is not in 0 ... {self.samples}")
        received: dict[_Key, tuple[Burst, ...]] = {}
        for key, port in ports.items():
            windows = self._noise_in(links.tick, direction, port)
            for base, train, bursts in port.sources:
                for burst in bursts:
                    self._carry(links, (base, train, direction), burst, windows)
            received[key] = windows
        return received

    def _carry(
        self, links: Links, link: tuple[int, int, int], burst: Burst, windows: tuple[Burst, ...]
    ) -> None:
        """Add what a burst brings over a link (base, train, direction) into the windows."""
        self._check(burst, link[2])
        rate_hz = self.description.sample_rate_hz
        for start, stop in _pieces(burst):
            listening = [w for w in windows if w.start < stop and start < w.stop]
            if not listening:
                continue
            gains = self._fading_of(*link).gains(
                links.run(*link), start / rate_hz, (stop - 1) / rate_hz, stop - start
            )
            sent = burst.samples[:, start - burst.start : stop - burst.start]
            gains *= sent.astype(np.complex64)
            arrived = gains.sum(axis=1)
            for window in listening:
                low, high = max(start, window.start), min(stop, window.stop)
                into = slice(low - window.start, high - window.start)
                window.samples[:, into] += arrived[:, low - start : high - start]

    def _fading_of(self, base: int, train: int, direction: int) -> LinkFading:
        """The one draw of a link in a direction."""
        known = self._fading.get((base, train, direction))
        if known is None:
            key = [self._seed, _FADING_STREAM, base, train, direction]
            rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(key)))
            radio = self.description
            carriers_hz = radio.uplink_hz if direction == UPLINK else radio.downlink_hz
            carrier_hz = carriers_hz[self._channel[base]]
            known = LinkFading(rng, *self._antennas[direction], carrier_hz, radio.rician_factor)
            self._fading[base, train, direction] = known
        return known

    def _noise_in(self, tick: int, direction: int, port: _Port) -> tuple[Burst, ...]:
        """White noise in every window of a port; of a sample it is the same in any window."""
        blocks = [
            range(start // _NOISE_SAMPLES, -(-stop // _NOISE_SAMPLES))
            for start, stop in port.windows
        ]
        first = port.number * _MOST_NOISE_BLOCKS
        places = [first + block for window in blocks for block in window]
        drawn = self._noise[direction].blocks(_STAGE[direction], places, tick)
        drawn *= np.float32(math.sqrt(port.noise_mw))
        # [antenna, block, sample]
        drawn = drawn.reshape(len(places), -1, _NOISE_SAMPLES).transpose(1, 0, 2)
        windows: list[Burst] = []
        at = 0
        for (start, stop), window in zip(port.windows, blocks, strict=True):
            rows = drawn[:, at : at + len(window)].reshape(len(drawn), -1)
            at += len(window)
            skip = start - window.start * _NOISE_SAMPLES
            # A copy: windows that share a block must not share memory.
            windows.append(Burst(start, rows[:, skip : skip + stop - start].copy()))
        return tuple(windows)

    def _noise_mw(self, links: Links, channel: int) -> float:
        """Noise power of a receiver on a channel, jammers included."""
        total: float = self.noise_mw
        for fault in self.description.faults:
            if fault.channel == channel and fault.acts(links.time_s):
                total += float(10.0 ** (fault.noise_dbm / 10.0))
        return total

    def _alive(self, links: Links) -> NDArray[np.bool_]:
        """Which base stations are not dead."""
        dead = {f.base_station for f in self.description.faults if f.acts(links.time_s)}
        return np.array([mast.name not in dead for mast in self.description.base_stations])

    def _check(self, burst: Burst, direction: int) -> None:
        """Refuse a burst that does not fit."""
        tx = self._antennas[direction][1]
        if burst.samples.ndim != 2 or len(burst.samples) != tx:
            raise ValueError(f"burst of {burst.samples.shape}, not [{tx}, sample]")
        if not 0 <= burst.start < burst.stop <= self.samples:
            raise ValueError(
                f"burst from {burst.start} to {burst.stop} is not in 0 ... {self.samples}"
            )


def _pieces(burst: Burst) -> Iterator[tuple[int, int]]:
    """Spans of samples that a burst is cut into, as equal as can be."""
    count = burst.samples.shape[1]
    pieces = -(-count // _PIECE_SAMPLES)
    borders = [burst.start + count * piece // pieces for piece in range(pieces + 1)]
    return pairwise(borders)
