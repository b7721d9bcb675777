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

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_world.line.description_base import whole_samples
from rail_world.ranging.medium import THERMAL_NOISE_DBM_PER_HZ
from rail_world.ranging.noise import NoiseSource

from .description import CbtcDescription
from .fading import FadingLinks, Piece
from .links import DOWNLINK, UPLINK, LinkGeometry, Links

__all__ = ["Burst", "CbtcMedium", "Links"]

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
        self._geometry = LinkGeometry(description, tick_s)
        self._channel = [mast.channel for mast in description.base_stations]
        base, train = description.base_antennas, description.train_antennas
        # [direction] of (receiver, sender)
        self._antennas = antennas = ((train, base), (base, train))
        figure_db = THERMAL_NOISE_DBM_PER_HZ + description.noise_figure_db
        self.noise_mw: float = 10.0 ** (figure_db / 10.0) * description.sample_rate_hz
        self._noise = [NoiseSource(seed, rx * _NOISE_SAMPLES) for rx, _ in antennas]
        carriers_hz = description.downlink_hz, description.uplink_hz
        self._fading = [
            FadingLinks(
                *(seed, direction, *antennas[direction]),
                [carriers_hz[direction][channel] for channel in self._channel],
                *(description.rician_factor, description.sample_rate_hz),
            )
            for direction in (DOWNLINK, UPLINK)
        ]

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
            Base station -> bursts it sends, one after the other; silent ones are missing.
        windows : mapping
            (train, channel) -> the spans [start, stop) of samples that the train listens to.

        Returns
        -------
        (train, channel) -> one burst complex64 [rx, sample] per window, signals and noise; missing
        if the train has no base station on the channel in reach, dead ones counted.

        Raises
        ------
        ValueError
            If a burst or a window does not fit the tick or the antennas, or bursts of a sender
            overlap or are not in order.
        """
        alive = self._alive(links).tolist()
        noise_mw = {channel: self._noise_mw(links, channel) for channel in set(self._channel)}
        # Of all pairs of a mast and a train few are near each other.
        near: dict[tuple[int, int], list[int]] = {}
        for train, base in np.argwhere(links.in_coverage.T).tolist():
            near.setdefault((train, self._channel[base]), []).append(base)
        ports: dict[tuple[int, int], _Port] = {}
        for key, spans in windows.items():
            if key in near:
                train, channel = key
                received = [base for base in near[key] if alive[base] and base in sent]
                ports[key] = _Port(
                    train * _MOST_CHANNELS + channel,
                    noise_mw[channel],
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
        if not ports:
            return {}
        spans, power_mw = [], []
        for port in ports.values():
            for start, stop in port.windows:
                if not 0 <= start < stop <= self.samples:
                    raise ValueError(f"window {start, stop} is not in 0 ... {self.samples}")
                spans.append((port.number * _MOST_NOISE_BLOCKS, start, stop))
                power_mw.append(port.noise_mw)
        heard = self._noise[direction].windows(
            _STAGE[direction],
            np.array(spans, dtype=np.int64).reshape(-1, 3),
            links.tick,
            np.array(power_mw),
            self._antennas[direction][0],
        )
        received: dict[_Key, tuple[Burst, ...]] = {}
        on_air = _OnAir(partial(self._check, direction))
        at = 0
        for key, port in ports.items():
            placed = []
            for start, stop in port.windows:
                placed.append((start, stop, at))
                at += stop - start
            received[key] = tuple(
                Burst(start, heard[:, begin : begin + stop - start])
                for start, stop, begin in placed
            )
            for base, train, bursts in port.sources:
                on_air.add(base, train, bursts, placed)
        sent = on_air.sent()
        # In the order of lengths: a sum must not depend on what other ports hear.
        for count, pieces in sorted(on_air.pieces.items()):
            self._fading[direction].add(links, pieces, count, sent, heard)
        return received

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

    def _check(self, direction: int, burst: Burst) -> None:
        """Refuse a burst that does not fit."""
        tx = self._antennas[direction][1]
        if burst.samples.ndim != 2 or len(burst.samples) != tx:
            raise ValueError(f"burst of {burst.samples.shape}, not [{tx}, sample]")
        if not 0 <= burst.start < burst.stop <= self.samples:
            raise ValueError(
                f"burst from {burst.start} to {burst.stop} is not in 0 ... {self.samples}"
            )


class _OnAir:
    """The bursts that somebody hears, side by side, and their pieces by length."""

    def __init__(self, check: Callable[[Burst], None]) -> None:
        self.pieces: dict[int, list[Piece]] = {}
        self._check = check
        self._spans: dict[int, tuple[list[int], list[int]]] = {}
        self._bursts: list[Burst] = []
        self._cut: dict[int, list[tuple[int, int, int]]] = {}
        self._end = 0

    def add(
        self,
        base: int,
        train: int,
        bursts: Sequence[Burst],
        windows: Sequence[tuple[int, int, int]],
    ) -> None:
        """Pieces of what a sender sends on a link, that windows (start, stop, place) listen to."""
        for burst in self._within(bursts, windows):
            for begin, end, place in self._cut.get(id(burst)) or self._place(burst):
                overlaps = tuple(
                    (max(begin, start) - begin, min(end, stop) - begin, at + max(begin - start, 0))
                    for start, stop, at in windows
                    if start < end and begin < stop
                )
                if overlaps:
                    piece = Piece(base, train, begin, place, overlaps)
                    self.pieces.setdefault(end - begin, []).append(piece)

    def _within(
        self, bursts: Sequence[Burst], windows: Sequence[tuple[int, int, int]]
    ) -> list[Burst]:
        """Bursts of a sender that some window listens to: few of the many that a mast sends."""
        spans = self._spans.get(id(bursts))
        if spans is None:
            for burst in bursts:
                self._check(burst)
            if any(one.stop > other.start for one, other in pairwise(bursts)):
                raise ValueError("bursts of a sender overlap, or are not in their order")
            spans = [burst.start for burst in bursts], [burst.stop for burst in bursts]
            self._spans[id(bursts)] = spans
        starts, stops = spans
        numbers: set[int] = set()
        for start, stop, _ in windows:
            numbers.update(range(bisect_right(stops, start), bisect_left(starts, stop)))
        return [bursts[number] for number in sorted(numbers)]

    def _place(self, burst: Burst) -> list[tuple[int, int, int]]:
        """Spans [begin, end) of the pieces of a burst, and where each is in what is sent."""
        self._bursts.append(burst)
        shift = self._end - burst.start
        self._cut[id(burst)] = cut = [(begin, end, begin + shift) for begin, end in _pieces(burst)]
        self._end += burst.samples.shape[1]
        return cut

    def sent(self) -> NDArray[np.float32]:
        """All that is sent [part, antenna, sample]."""
        if not self._bursts:
            return np.empty((2, 0, 0), dtype=np.float32)
        samples = np.concatenate([burst.samples for burst in self._bursts], axis=1)
        return np.array((samples.real, samples.imag), dtype=np.float32)


def _pieces(burst: Burst) -> Iterator[tuple[int, int]]:
    """Spans of samples that a burst is cut into, as equal as can be."""
    count = burst.samples.shape[1]
    pieces = -(-count // _PIECE_SAMPLES)
    borders = [burst.start + count * piece // pieces for piece in range(pieces + 1)]
    return pairwise(borders)
