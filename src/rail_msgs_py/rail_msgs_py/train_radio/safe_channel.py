"""One end of a safe channel over open radio (EN 50159:2010, category 3).

================ ===================================================================
threat           defence
================ ===================================================================
repetition       sequence number, always above the newest accepted one
deletion         gap in the sequence numbers is counted; `silence_s` for the time-out
insertion        safety code
resequencing     sequence number
corruption       safety code
delay            the oldest that a frame can be, by a bound on the offset of the clocks
masquerade       source and destination, a key for each direction of each pair and
                 each session, kinds that this end takes; safety code
restart of an    a session key made from a random nonce of either end: what was
end              recorded before has another key
================ ===================================================================

**Sessions.** Each end offers a nonce that it draws anew for every session. While there is no
session, `seal` gives greetings: my offer, and an echo of the peer's offer (zero if none is known).
A greeting is never data. A session stands as soon as the peer has proved that it knows my present
offer, by a greeting that echoes it or by data under the key of both offers; so the proof is as
fresh as the offer, and whatever was recorded before it was drawn is of no use. A greeting from an
end that was started anew is answered beside the running session, which ends only when the new one
is proved: a recorded greeting cannot cut a link. When nothing is accepted for `session_timeout_s`
the session is given up and offered again. (EuroRadio, UNISIG SUBSET-037, does the same with random
numbers A and B, in three messages of their own.)

**Clocks.** Each end has its own, and nothing is assumed of them but a bound on their drift. What a
frame says it has heard, its feedback, tells when it was sealed at the earliest by the receiver's
own clock; `clock_offset` makes bounds on the offset of them, which greetings begin. A frame
whose oldest possible age is above `max_age_s` is refused. A clock that jumps is noticed, by its own
end if it goes back, by a bound that is crossed otherwise: then the session is given up. Should the
peer's clock jump at the very time when frames are held back by as much, `session_timeout_s` since
the last frame of mine that the peer had is the limit, which rests on no clock but one's own.

Time is what the caller's clock shows; randomness comes from a function passed in.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from rail_msgs_py.stamps import NANOSECONDS, seconds_to_ns

from .clock_offset import AgeBounds, ClockOffset, SentTimes
from .fixed_point import check_identity, check_number
from .safe_frame import (
    FRAME_BYTES,
    GREETING_BIT,
    LAST_SEQUENCE,
    LAST_TIME_NS,
    NONCE_BYTES,
    PAYLOAD_BYTES,
    VERSION,
    DirectionKeys,
    FrameKind,
    Header,
    SafetyCode,
    SessionKey,
    payload_of,
    read_header,
)
from .safe_result import Accepted, Greeted, Opened, Rejected, RejectionReason

_NO_NONCE: Final = bytes(NONCE_BYTES)
_GREETING: Final = int(FrameKind.GREETING)
#: Most that a clock is allowed to gain or lose per time.
CLOCK_DRIFT: Final = 2e-4


@dataclass(slots=True)
class _Session:
    own_nonce: bytes
    peer_nonce: bytes
    transmit: SessionKey
    receive: SessionKey
    #: Number of the newest greeting that showed the peer's nonce.
    greeting: int
    offset: ClockOffset
    sent: SentTimes = field(default_factory=SentTimes)
    newest: int = 0


class SafeChannel:
    """One end of the channel between two ends; what it remembers is of fixed size.

    Parameters
    ----------
    authentication_key : bytes
        Of the pair, 16 bytes at least, the same at both ends.
    own, peer : int
        Identities, 0 to 65535, different.
    accepts : kinds
        What this end takes as data.
    draw : function of a count
        Gives so many random bytes: ``numpy.random.Generator.bytes`` in a simulation; in earnest
        it would have to be ``secrets.token_bytes``. What it gives must never have been given
        before, through any restart: the proof of a session rests on it.
    max_age_s : float
        Age above which a frame is rejected.
    least_delay_s : float
        Least time from sealing to opening, by the way that frames go; 0 is always right.
    clock_drift : float
        Most that either clock gains or loses per time.
    session_timeout_s : float
        Silence after which a session is given up.
    """

    def __init__(
        self,
        authentication_key: bytes,
        own: int,
        peer: int,
        accepts: Iterable[FrameKind],
        draw: Callable[[int], bytes],
        *,
        max_age_s: float = 1.0,
        least_delay_s: float = 0.0,
        clock_drift: float = CLOCK_DRIFT,
        session_timeout_s: float = 5.0,
    ) -> None:
        check_identity("own", own)
        check_identity("peer", peer)
        if own == peer:
            raise ValueError(f"own and peer must differ, got {own!r} for both")
        check_number("max_age_s", max_age_s, 1e-3, 1e6)
        check_number("least_delay_s", least_delay_s, 0.0, max_age_s)
        check_number("clock_drift", clock_drift, 0.0, 1e-2)
        check_number("session_timeout_s", session_timeout_s, max_age_s, 1e6)
        self.own, self.peer = own, peer
        self._accepts = {int(kind): kind for kind in accepts if kind is not FrameKind.GREETING}
        self._draw = draw
        self._transmit = DirectionKeys(authentication_key, own, peer)
        self._receive = DirectionKeys(authentication_key, peer, own)
        self._max_age_ns = seconds_to_ns(max_age_s)
        self._new_offset = partial(ClockOffset, seconds_to_ns(least_delay_s), clock_drift)
        self._timeout_ns = seconds_to_ns(session_timeout_s)
        self._offer = draw(NONCE_BYTES)
        self._session: _Session | None = None
        self._candidate: _Session | None = None
        self._answer_owed = self._greeted_last = False
        self._greetings = SentTimes()
        self._greeting_ns = -1
        self._last_accepted_ns = 0
        self._newest_ns: int | None = None
        self._now_ns = 0

    @property
    def established(self) -> bool:
        """Whether there is a session."""
        return self._session is not None

    def silence_s(self, time_ns: int) -> float:
        """Age of the newest accepted data [s], infinite if there is none since the start."""
        if self._newest_ns is None:
            return math.inf
        return (time_ns - self._newest_ns) / NANOSECONDS

    def seal(self, kind: FrameKind, payload: bytes, time_ns: int) -> bytes:
        """Frame of 64 bytes to send now.

        It is a greeting, without the payload, while there is no session, and once when the peer
        asks for a new one: telegrams are periodic, the next carries fresher content anyway.

        Raises
        ------
        ValueError
            If the kind is that of greetings, the payload too long or the time out of range.
        """
        if kind is FrameKind.GREETING:
            raise ValueError("kind must be one of data, got GREETING")
        if len(payload) > PAYLOAD_BYTES:
            raise ValueError(f"payload must have at most {PAYLOAD_BYTES} bytes, got {len(payload)}")
        if not 0 <= time_ns <= LAST_TIME_NS:
            raise ValueError(f"time_ns must be from 0 to {LAST_TIME_NS}, got {time_ns!r}")
        self._keep_time(time_ns)
        session = self._session
        if session is not None and (
            time_ns - self._last_accepted_ns > self._timeout_ns
            or session.sent.count >= LAST_SEQUENCE
        ):
            session = self._session = None
        # Every other frame at most is an answer, so that recorded greetings cannot stop the data.
        if session is None or (self._answer_owed and not self._greeted_last):
            return self._greeting(time_ns)
        self._greeted_last = False
        number = session.sent.add(time_ns)
        key = session.transmit
        header = Header(
            VERSION,
            kind,
            len(payload),
            self.own,
            self.peer,
            number,
            time_ns,
            session.newest or GREETING_BIT | session.greeting,
            key.mark,
        )
        return key.code.seal(header, payload)

    def _greeting(self, time_ns: int) -> bytes:
        self._answer_owed, self._greeted_last = False, True
        candidate = self._candidate
        echo, heard = (candidate.peer_nonce, candidate.greeting) if candidate else (_NO_NONCE, 0)
        number = self._greetings.add(time_ns)
        ends, feedback = (self.own, self.peer), GREETING_BIT | heard
        header = Header(
            VERSION, FrameKind.GREETING, 2 * NONCE_BYTES, *ends, number, time_ns, feedback, 0
        )
        return self._transmit.greeting.seal(header, self._offer + echo)

    def open(self, frame: bytes, time_ns: int) -> Opened:
        """What to make of bytes that arrived now; it never raises, whatever they are."""
        if len(frame) != FRAME_BYTES:
            return Rejected(RejectionReason.MALFORMED)
        header = read_header(frame)
        if header.version != VERSION or header.length > PAYLOAD_BYTES:
            return Rejected(RejectionReason.MALFORMED)
        greeting = header.kind == _GREETING
        if not greeting and header.kind not in self._accepts:
            return Rejected(RejectionReason.UNEXPECTED_KIND)
        if header.source != self.peer or header.destination != self.own:
            return Rejected(RejectionReason.WRONG_ADDRESS)
        self._keep_time(time_ns)
        if greeting:
            if not self._genuine(self._receive.greeting, frame):
                return Rejected(RejectionReason.SAFETY_CODE)
            return self._greet(header, payload_of(frame), time_ns)
        session = self._session_of(header.mark)
        if session is None:
            return Rejected(RejectionReason.UNKNOWN_SESSION)
        if not self._genuine(session.receive.code, frame):
            return Rejected(RejectionReason.SAFETY_CODE)
        sent_ns = self._sent_ns(header.feedback, session)
        if sent_ns is not None and not session.offset.learn(header.time_ns, sent_ns, time_ns):
            self._start_anew()
            return Rejected(RejectionReason.CLOCK_JUMPED)
        age = session.offset.age(header.time_ns, time_ns)
        reason = self._untimely(age, sent_ns, time_ns) or self._misplaced(header, session)
        if reason or age is None:
            return Rejected(reason or RejectionReason.TOO_OLD)
        return self._accept(header, payload_of(frame, header.length), session, age, time_ns)

    def _genuine(self, code: SafetyCode, frame: bytes) -> bool:
        return code.matches(frame)

    def _session_of(self, mark: int) -> _Session | None:
        for session in (self._session, self._candidate):
            if session is not None and session.receive.mark == mark:
                return session
        return None

    def _untimely(
        self, age: AgeBounds | None, sent_ns: int | None, time_ns: int
    ) -> RejectionReason | None:
        """Whether a frame may be too old, or what it has heard was sent too long ago."""
        if age is None or sent_ns is None or time_ns - sent_ns > self._timeout_ns:
            return RejectionReason.TOO_OLD
        return RejectionReason.TOO_OLD if age.most_ns > self._max_age_ns else None

    def _sent_ns(self, feedback: int, session: _Session) -> int | None:
        """When what a frame has heard was sent; None if that is not remembered."""
        if feedback & GREETING_BIT:
            return self._greetings.of(feedback ^ GREETING_BIT)
        return session.sent.of(feedback)

    def _keep_time(self, time_ns: int) -> None:
        """Notice that one's own clock has gone back."""
        if time_ns < self._now_ns:
            self._start_anew()
        self._now_ns = time_ns

    def _start_anew(self) -> None:
        """Forget all that rests on a clock that has jumped: sessions, and when what was sent."""
        self._session = self._candidate = None
        self._greetings.forget()
        self._offer = self._draw(NONCE_BYTES)
        self._answer_owed = False
        self._greeting_ns, self._newest_ns = -1, None

    def _misplaced(self, header: Header, session: _Session) -> RejectionReason | None:
        return _disorder(header.sequence, session.newest)

    def _accept(
        self, header: Header, payload: bytes, session: _Session, age: AgeBounds, time_ns: int
    ) -> Accepted:
        if session is not self._session:
            self._establish(session)
        lost = header.sequence - session.newest - 1
        session.newest = header.sequence
        self._last_accepted_ns, self._newest_ns = time_ns, time_ns - age.most_ns
        age_s = age.most_ns / NANOSECONDS
        doubt_s = (age.most_ns - max(0, age.least_ns)) / NANOSECONDS
        kind = self._accepts[header.kind]
        return Accepted(kind, payload, age_s, doubt_s, header.sequence, lost, header.feedback)

    def _greet(self, header: Header, payload: bytes, time_ns: int) -> Greeted | Rejected:
        nonce, echo = payload[:NONCE_BYTES], payload[NONCE_BYTES:]
        session = self._session
        if echo == self._offer:
            # It answers a greeting of mine: one recorded before that would not know my offer.
            return self._prove(header, self._candidate_of(nonce, header), time_ns)
        if reason := self._unwelcome(header, time_ns):
            return Rejected(reason)
        self._greeting_ns = header.time_ns
        if (
            session is not None
            and nonce == session.peer_nonce
            and echo in (_NO_NONCE, session.own_nonce)
        ):
            session.greeting = max(session.greeting, header.sequence)
            return Greeted(False)  # of the running session, sent before the peer knew it
        self._candidate_of(nonce, header)
        self._answer_owed = True
        return Greeted(False)

    def _candidate_of(self, nonce: bytes, header: Header) -> _Session:
        """The session that could be with an offer of the peer; its greeting has been heard."""
        candidate = self._candidate
        if candidate is None or candidate.peer_nonce != nonce:
            candidate = self._candidate = _Session(
                self._offer,
                nonce,
                self._transmit.session(self._offer, nonce),
                self._receive.session(nonce, self._offer),
                header.sequence,
                self._new_offset(),
            )
        candidate.greeting = max(candidate.greeting, header.sequence)
        return candidate

    def _prove(self, header: Header, candidate: _Session, time_ns: int) -> Greeted | Rejected:
        """Establish the session of a greeting that knows my offer, unless that is too old."""
        self._answer_owed = True
        sent_ns = self._greetings.of(header.feedback ^ GREETING_BIT)
        candidate.offset = self._new_offset()
        if sent_ns is not None and not candidate.offset.learn(header.time_ns, sent_ns, time_ns):
            return Rejected(RejectionReason.FROM_THE_FUTURE)
        age = candidate.offset.age(header.time_ns, time_ns)
        if reason := self._untimely(age, sent_ns, time_ns):
            return Rejected(reason)
        self._greeting_ns = header.time_ns
        self._last_accepted_ns = time_ns
        self._establish(candidate)
        return Greeted(True)

    def _unwelcome(self, header: Header, time_ns: int) -> RejectionReason | None:
        """Why a greeting that proves nothing is not answered.

        It is no danger, but answers cost data: while there is a session, whose peer has a clock
        that is known, old ones go unanswered.
        """
        session = self._session
        age = None if session is None else session.offset.age(header.time_ns, time_ns)
        if age is None:
            same = header.time_ns == self._greeting_ns
            return RejectionReason.REPEATED if same else None
        if age.most_ns > self._max_age_ns:
            return RejectionReason.TOO_OLD
        return _disorder(header.time_ns, self._greeting_ns)

    def _establish(self, session: _Session) -> None:
        self._session, self._candidate = session, None
        self._offer = self._draw(NONCE_BYTES)
        self._answer_owed = False


def _disorder(number: int, newest: int) -> RejectionReason | None:
    if number > newest:
        return None
    return RejectionReason.REPEATED if number == newest else RejectionReason.OUT_OF_ORDER
