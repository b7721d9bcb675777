"""Receiver of track codes: where it is run, and what of it can be judged."""

from __future__ import annotations

from math import inf
from typing import Any, ClassVar

from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_RX, CODE_SENT
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.kind import FLAG, EquipmentKind, Ports, ValueRange

#: Time that a word which is no longer sent may still be the last decided: two slots [s].
HELD_S = 4.0


class TrackCodeReceiver(EquipmentKind):
    """Receiver of a train that follows another through blocks."""

    name: ClassVar[str] = "track_code_receiver"
    title: ClassVar[str] = "receiver of track codes"
    node_kind: ClassVar[str] = "track_code_receiver"
    scenario: ClassVar[dict[str, Any]] = {
        "name": "track_code_conformance",
        "seed": 5,
        "duration_s": 300.0,
        "tick_s": 0.25,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 3000}],
                "speed_limits": [[0, 100], [1200, 80]],
                "stops_m": [2700],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "track_circuits": {"length_m": 500},
        "trains": [
            {"name": "leader", "route": ["main"], "start_m": 1400},
            {"name": "follower", "route": ["main"], "start_m": 350},
        ],
    }
    ranges: ClassVar[dict[str, dict[str, ValueRange]]] = {
        CODE_RECEIVED.pattern: {
            "carrier_hz": ValueRange(0.0, 1e5),
            "valid": FLAG,
            "word": ValueRange(0.0, 2.0**53),
            "speed": ValueRange(0.0, 255.0),
            "gradient": ValueRange(0.0, 255.0),
            "block_length": ValueRange(0.0, 255.0),
            "network": ValueRange(0.0, 7.0),
            "level_db": ValueRange(-400.0, 200.0, unknown=(-inf,)),
        }
    }
    notices_within_s: ClassVar[float] = HELD_S
    recovers_within_s: ClassVar[float] = 10.0

    def ports(self, bench: Bench) -> Ports:
        """Topics of its train."""
        train = bench.place
        heard = {CODE_RX.name(train=train): CODE_RX}
        return Ports(heard, {}, {CODE_RECEIVED.name(train=train): CODE_RECEIVED})

    def message(self, bench: Bench) -> Any:
        """What it has understood in the last tick."""
        return bench.output(CODE_RECEIVED, train=bench.place).latest

    def working(self, bench: Bench) -> bool:
        """It has a valid word."""
        return bool(self.message(bench).valid)

    def sent_words(self, bench: Bench, within_s: float = HELD_S) -> set[int]:
        """Words that any circuit has sent lately."""
        count = 1 + round(within_s / bench.tick_s)
        words = set()
        for name in bench.corridor.topics:
            if CODE_SENT.matches(name):
                views = bench.corridor.topic(name).newest(count)
                words |= {int(view.word) for view in views if view.word == view.word}
        return words

    def false_claim(self, bench: Bench) -> str:
        """A valid word that nobody sends, or the fields of another one."""
        message = self.message(bench)
        if not message.valid:
            told = [name for name in ("speed", "word") if getattr(message, name) != 0.0]
            return f"gives {told[0]} of a word that is not valid" if told else ""
        if int(message.word) in self.sent_words(bench):
            return ""
        return f"the word {int(message.word):#x} is valid, but no circuit has sent it"

    def knows_too_much(self, bench: Bench) -> str:
        """In one tick no word can have been received."""
        return "has a valid word in its first tick after a restart" if self.working(bench) else ""

    def not_silent(self, bench: Bench) -> str:
        """It must have no word and no carrier."""
        message = self.message(bench)
        if message.valid or message.carrier_hz:
            return "is switched off and has a carrier or a valid word"
        return ""

    def believes_garbage(self, bench: Bench) -> str:
        """No word may be left."""
        if not self.working(bench):
            return ""
        word = int(self.message(bench).word)
        return f"the word {word:#x} is still valid, though no code has come for {HELD_S:g} s"


KIND = TrackCodeReceiver()
