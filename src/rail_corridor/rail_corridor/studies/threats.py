"""The threat campaign: what the safe channel lets through while it is attacked.

A zone controller exchanges frames with several trains over links on which the threats of
EN 50159 are at work. Ends are restarted at random all through the run. An oracle that knows all
that was sealed judges every frame that is accepted. It knows nothing of keys, numbers or nonces:
what a receiver accepts must be, to the byte, a frame that the right peer sealed for it, with that
content, no older than the age limit, sealed since the receiver last started, and sealed after
everything that the receiver accepted before. Anything else is a wrong acceptance.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple, Protocol

import numpy as np
from pydantic import Field

from rail_corridor.study.strict import Strict
from rail_msgs_py.stamps import NANOSECONDS, seconds_to_ns
from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.safe_result import Accepted, Greeted, Opened
from rail_world.train_radio.frame_threats import Arrival, FrameThreats, Link, Threat, ThreatRates

ALONE_RATE: Final = 0.25
TOGETHER_RATE: Final = 0.1
RESTART_RATE: Final = 1.0 / 150.0
MAX_AGE_S: Final = 1.0
LATENCY_S: Final = 0.02
PERIOD_S: Final = 0.25

_MAX_AGE_NS = seconds_to_ns(MAX_AGE_S)
_CONTROLLER = 1
_TRAINS = (101, 102, 103)
_KEY = b"the secret of the threat campaign"
_CAMPAIGN_STREAM = 50159


class End(Protocol):
    """What the campaign asks of one end."""

    def seal(self, kind: FrameKind, payload: bytes, time_ns: int) -> bytes:
        """Frame to send."""

    def open(self, frame: bytes, time_ns: int) -> Opened:
        """What to make of a frame."""


#: Makes the end (own, peer) that takes one kind of data, with a source of random bytes.
MakeEnd = Callable[[int, int, FrameKind, Callable[[int], bytes]], End]


def safe_end(own: int, peer: int, kind: FrameKind, draw: Callable[[int], bytes]) -> SafeChannel:
    """The end under test."""
    return SafeChannel(_KEY, own, peer, [kind], draw, max_age_s=MAX_AGE_S)


@dataclass(slots=True)
class CampaignRow:
    """What became of the frames under one threat, or under several together.

    Parameters
    ----------
    threats : str
    frames : int
        Sealed and sent by the ends.
    restarts : int
        Of ends.
    attacks : int
        How often a threat struck.
    arrived : int
        Frames that came to an end, genuine or not.
    accepted, greeted : int
        Rightly accepted as data; taken as greetings.
    wrongly_accepted : dict of str to int
        By what is wrong; must be empty.
    reported_lost : int
        Frames that the receivers found missing.
    rejected : dict of str to int
        By the reason the receiver gave.
    """

    threats: str
    frames: int = 0
    restarts: int = 0
    attacks: int = 0
    arrived: int = 0
    accepted: int = 0
    greeted: int = 0
    reported_lost: int = 0
    wrongly_accepted: Counter[str] = field(default_factory=Counter)
    rejected: Counter[str] = field(default_factory=Counter)


class _Sealed(NamedTuple):
    order: int
    time_ns: int
    kind: FrameKind
    payload: bytes


class _Oracle:
    """Knows what was sealed for whom, and what each receiver took."""

    def __init__(self, links: Iterable[Link]) -> None:
        self._sealed: dict[Link, dict[bytes, _Sealed]] = {link: {} for link in links}
        self._newest = dict.fromkeys(self._sealed, -1)
        self._started = dict.fromkeys(self._sealed, 0)
        self._order = 0

    def seal(self, link: Link, frame: bytes, time_ns: int, kind: FrameKind, payload: bytes) -> None:
        self._sealed[link][frame] = _Sealed(self._order, time_ns, kind, payload)
        self._order += 1

    def restart(self, link: Link) -> None:
        """The receiver of the link starts anew."""
        self._started[link] = self._order

    def fault(self, arrival: Arrival, accepted: Accepted) -> str | None:
        """What is wrong with an acceptance, None if nothing."""
        link = arrival.link
        sealed = self._sealed[link].get(arrival.frame)
        if sealed is None:
            return "not sealed by the peer for this end"
        if accepted.payload != sealed.payload or accepted.kind != sealed.kind:
            return "other content than was sealed"
        if sealed.order < self._started[link]:
            return "from before the receiver's start"
        if arrival.time_ns - sealed.time_ns > _MAX_AGE_NS:
            return "too old"
        if sealed.order <= self._newest[link]:
            return "accepted before, or out of order"
        self._newest[link] = sealed.order
        return None


class ThreatParameters(Strict):
    """Frames under a threat."""

    threat: Literal["all"] | Threat = "all"
    frames: int = Field(10_000, ge=1, le=100_000_000)


def count_threats(parameters: ThreatParameters, seed: int) -> dict[str, float | None]:
    """Frames of the safe channel under attack: rejected, taken, wrongly taken."""
    group = list(Threat) if parameters.threat == "all" else [parameters.threat]
    (row,) = run_threat_campaign(parameters.frames, [group], seed)
    return {
        "frames": row.frames,
        "restarts": row.restarts,
        "attacks": row.attacks,
        "arrived": row.arrived,
        "rejected": sum(row.rejected.values()),
        "accepted": row.accepted,
        "wrongly_accepted": sum(row.wrongly_accepted.values()),
    }


def run_threat_campaign(
    frames: int = 100_000,
    threats: Sequence[Sequence[Threat]] | None = None,
    seed: int = 1,
    make_end: MakeEnd = safe_end,
) -> list[CampaignRow]:
    """One row for each group of threats.

    Parameters
    ----------
    frames : int
        To send at least, in each row.
    threats : groups of threats
        By default each of the seven alone, then all together.
    seed : int
    make_end
        By default the end of the project; another one to see that the campaign finds its faults.
    """
    if frames < 1:
        raise ValueError(f"frames must be 1 or more, got {frames!r}")
    groups = [[threat] for threat in Threat] + [list(Threat)] if threats is None else threats
    # A row depends on its own threats only, not on which others are run beside it.
    return [_run(frames, group, seed, make_end) for group in groups]


def _run(frames: int, group: Sequence[Threat], seed: int, make_end: MakeEnd) -> CampaignRow:
    rate = ALONE_RATE if len(group) == 1 else TOGETHER_RATE
    places = [place for place, threat in enumerate(Threat) if threat in group]
    children = np.random.SeedSequence([seed, _CAMPAIGN_STREAM, *places]).spawn(3)
    attack_rng, nonce_rng, restart_rng = map(np.random.default_rng, children)
    radio = FrameThreats(
        ThreatRates(**{threat.value: rate for threat in group}), attack_rng, latency_s=LATENCY_S
    )
    # The link (source, destination) leads to the end of its destination.
    links: list[Link] = [
        link for train in _TRAINS for link in ((train, _CONTROLLER), (_CONTROLLER, train))
    ]

    def start(link: Link) -> End:
        source, destination = link
        return make_end(destination, source, kinds[link], nonce_rng.bytes)

    kinds = {link: _kind_on(link) for link in links}
    ends = {link: start(link) for link in links}
    oracle = _Oracle(links)
    row = CampaignRow("+".join(threat.value for threat in group) or "none")
    if len(group) == len(Threat):
        row.threats = "all together"
    period_ns = round(PERIOD_S * NANOSECONDS)
    time_ns = 0
    while row.frames < frames:
        for link, draw in zip(links, restart_rng.random(len(links)).tolist(), strict=True):
            if draw < RESTART_RATE:
                ends[link] = start(link)
                oracle.restart(link)
                row.restarts += 1
        for link in links:
            source, destination = link
            kind, payload = kinds[link], row.frames.to_bytes(32, "big")
            frame = ends[destination, source].seal(kind, payload, time_ns)
            oracle.seal(link, frame, time_ns, kind, payload)
            radio.send(link, frame, time_ns)
            row.frames += 1
        time_ns += period_ns
        for arrival in radio.arrivals(time_ns - 1):
            _judge(row, oracle, arrival, ends[arrival.link].open(arrival.frame, arrival.time_ns))
    row.attacks = sum(radio.strikes.values())
    return row


def _kind_on(link: Link) -> FrameKind:
    return FrameKind.LOCATION_REPORT if link[1] == _CONTROLLER else FrameKind.MOVEMENT_AUTHORITY


def _judge(row: CampaignRow, oracle: _Oracle, arrival: Arrival, opened: Opened) -> None:
    row.arrived += 1
    if isinstance(opened, Accepted):
        fault = oracle.fault(arrival, opened)
        if fault is None:
            row.accepted += 1
            row.reported_lost += opened.lost
        else:
            row.wrongly_accepted[fault] += 1
    elif isinstance(opened, Greeted):
        row.greeted += 1
    else:
        row.rejected[opened.reason.value] += 1
