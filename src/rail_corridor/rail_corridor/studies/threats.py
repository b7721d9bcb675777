"""The threat campaign: what the safe channel lets through while it is attacked.

A zone controller exchanges frames with several trains over links on which the threats of
EN 50159 are at work, or an intruder who plays to ends that are started anew how they began before
(`rail_world.train_radio.directed_replay`), or one who holds all frames back by more and more
(`rail_world.train_radio.growing_delay`). Ends are restarted at random all through the run, one
alone or both of a link; each has a clock of its own, which is wrong and drifts, and is set to
another time at half of the restarts. An oracle that knows all that was sealed, and true time,
judges every frame that is accepted. It knows nothing of keys, numbers or nonces:
what a receiver accepts must be, to the byte, a frame that the right peer sealed for it, with that
content, no older than the age limit, sealed since the receiver last started, and sealed after
everything that the receiver accepted before. Anything else is a wrong acceptance; so is a session
that a greeting from before the receiver's start establishes.
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
from rail_msgs_py.train_radio.train_channel import nonces
from rail_msgs_py.train_radio.unit_clock import ClockFault, UnitClock
from rail_world.train_radio.directed_replay import DirectedReplay
from rail_world.train_radio.frame_threats import Arrival, FrameThreats, Link, Threat, ThreatRates
from rail_world.train_radio.growing_delay import GrowingDelay

ALONE_RATE: Final = 0.25
TOGETHER_RATE: Final = 0.1
RESTART_RATE: Final = 1.0 / 150.0
#: The restarts at which both ends of the link are started anew.
BOTH_RATE: Final = 0.5
#: Clocks are wrong by so much at most, and drift by so much.
MOST_OFFSET_S: Final = 10.0
MOST_DRIFT_PPM: Final = 200.0
#: Who has a plan of his own.
Intruder = Literal["directed_replay", "growing_delay"]
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
    return SafeChannel(_KEY, own, peer, [kind], draw, max_age_s=MAX_AGE_S, least_delay_s=LATENCY_S)


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

    def is_recorded(self, arrival: Arrival) -> bool:
        """Whether a frame is from before the receiver's start."""
        sealed = self._sealed[arrival.link].get(arrival.frame)
        return sealed is None or sealed.order < self._started[arrival.link]

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

    threat: Literal["all"] | Intruder | Threat = "all"
    frames: int = Field(10_000, ge=1, le=100_000_000)


def count_threats(parameters: ThreatParameters, seed: int) -> dict[str, float | None]:
    """Frames of the safe channel under attack: rejected, taken, wrongly taken."""
    threat = parameters.threat
    if threat == "directed_replay" or threat == "growing_delay":
        row = run_intruder_campaign(threat, parameters.frames, seed)
    else:
        group = list(Threat) if threat == "all" else [Threat(threat)]
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


def run_intruder_campaign(
    intruder: Intruder, frames: int = 100_000, seed: int = 1, make_end: MakeEnd = safe_end
) -> CampaignRow:
    """The row of an intruder with a plan; parameters as of `run_threat_campaign`.

    ``directed_replay`` plays to ends that are started anew, ten times as often as under the
    threats, how they began before; ``growing_delay`` holds back all frames by more and more.
    """
    row = _run(frames, [], seed, make_end, intruder)
    row.threats = intruder
    return row


def _run(
    frames: int,
    group: Sequence[Threat],
    seed: int,
    make_end: MakeEnd,
    intruder: Intruder | None = None,
) -> CampaignRow:
    rate = ALONE_RATE if len(group) == 1 else TOGETHER_RATE
    places = [place for place, threat in enumerate(Threat) if threat in group]
    children = np.random.SeedSequence([seed, _CAMPAIGN_STREAM, *places]).spawn(4)
    attack_rng, clock_rng, restart_rng, replay_rng = map(np.random.default_rng, children)
    radio = FrameThreats(
        ThreatRates(**{threat.value: rate for threat in group}), attack_rng, latency_s=LATENCY_S
    )
    replay, delay = DirectedReplay(replay_rng), GrowingDelay(replay_rng)
    # The link (source, destination) leads to the end of its destination.
    links: list[Link] = [
        link for train in _TRAINS for link in ((train, _CONTROLLER), (_CONTROLLER, train))
    ]
    clocks: dict[Link, UnitClock] = {}
    ends: dict[Link, End] = {}
    oracle = _Oracle(links)
    row = CampaignRow("+".join(threat.value for threat in group) or "none")
    if len(group) == len(Threat):
        row.threats = "all together"

    def start(link: Link, time_ns: int) -> None:
        source, destination = link
        if link not in clocks or clock_rng.random() < 0.5:
            offset_s = clock_rng.uniform(-MOST_OFFSET_S, MOST_OFFSET_S)
            drift_ppm = clock_rng.uniform(-MOST_DRIFT_PPM, MOST_DRIFT_PPM)
            clocks[link] = UnitClock([ClockFault(0.0, offset_s, drift_ppm)])
        draw = nonces(seed, destination, source, time_ns)
        ends[link] = make_end(destination, source, _kind_on(link), draw)

    for link in links:
        start(link, 0)
    period_ns = round(PERIOD_S * NANOSECONDS)
    restart_rate = (10.0 if intruder == "directed_replay" else 1.0) * RESTART_RATE
    time_ns = 0
    while row.frames < frames:
        for link in _restarted(links, restart_rng, restart_rate) if time_ns else ():
            start(link, time_ns)
            oracle.restart(link)
            replay.restart(link)
            row.restarts += 1
        for link in links:
            back = link[::-1]
            kind, payload = _kind_on(link), row.frames.to_bytes(32, "big")
            frame = ends[back].seal(kind, payload, clocks[back].read_ns(time_ns))
            oracle.seal(link, frame, time_ns, kind, payload)
            radio.send(link, frame, time_ns)
            row.frames += 1
        arrivals = radio.arrivals(time_ns + period_ns - 1)
        if intruder == "growing_delay":
            arrivals = delay.arrivals(arrivals, time_ns + period_ns)
        elif intruder == "directed_replay":
            arrivals = _played(row, replay, links, arrivals, time_ns + 2 * seconds_to_ns(LATENCY_S))
        for arrival in arrivals:
            end, clock = ends[arrival.link], clocks[arrival.link]
            _judge(row, oracle, arrival, end.open(arrival.frame, clock.read_ns(arrival.time_ns)))
        time_ns += period_ns
    row.attacks += sum(radio.strikes.values()) + delay.count
    return row


def _restarted(links: Sequence[Link], rng: np.random.Generator, rate: float) -> list[Link]:
    """Links whose receivers are started anew in a tick; of some both ends are."""
    draws = rng.random((len(links), 2)).tolist()
    chosen: dict[Link, None] = {}
    for link, (draw, both) in zip(links, draws, strict=True):
        if draw < rate:
            chosen[link] = None
            if both < BOTH_RATE:
                chosen[link[1], link[0]] = None
    return list(chosen)


def _played(
    row: CampaignRow,
    replay: DirectedReplay,
    links: Iterable[Link],
    arrivals: list[Arrival],
    time_ns: int,
) -> list[Arrival]:
    """Arrivals of a tick with what is played beside them, after what is genuine."""
    for arrival in arrivals:
        replay.hear(arrival.link, arrival.frame)
    played = [
        Arrival(time_ns, link, frame, Threat.REPETITION, -1)
        for link in links
        for frame in replay.play(link)
    ]
    row.attacks += len(played)
    return arrivals + played


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
        if opened.established and oracle.is_recorded(arrival):
            row.wrongly_accepted["session from a recorded greeting"] += 1
    else:
        row.rejected[opened.reason.value] += 1
