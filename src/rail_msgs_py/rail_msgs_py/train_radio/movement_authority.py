"""Movement authority: how far a train may go, and how fast (IEEE 1474.1).

Layout, 32 bytes, big endian:

====== ===== ============================================================== ==========
offset bytes field                                                          resolution
====== ===== ============================================================== ==========
0      2     train
2      2     segment
4      4     end of authority, signed                                       0.01 m
8      2     limit                                                          0.01 m/s
10     2     validity                                                       0.01 s
12     1     flags: 1 towards greater chainages, 2 emergency stop; bits 2-3
             the number of steps; 16 located; 32 release; the others are
             zero
13     12    two steps of the limit: from, signed (4), limit (2);           0.01 m,
             those not used are zero                                        0.01 m/s
25     4     where the front was ranged to be, signed                       0.01 m
29     2     half-width of that interval; both zero if not located          0.1 m
31     1     overlap, from the end to the danger point                      0.5 m
====== ===== ============================================================== ==========

Who reads an authority never believes it to reach further, to allow more or to last longer than
who wrote it: the end is rounded towards the train, limits and validity down; a step to a lower
limit begins earlier, one to a higher limit later. The half-width covers the rounding of the place.
The overlap is rounded down, and counts from the end as it was rounded.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from .fixed_point import check_direction, check_identity, check_number, covering, down, up

FURTHEST_M: Final = 1e6
FASTEST_MPS: Final = 200.0
LONGEST_S: Final = 600.0
MOST_STEPS: Final = 2
WIDEST_M: Final = 6553.5
#: Longest overlap that can be told; a longer one counts as this.
LONGEST_OVERLAP_M: Final = 127.5

PER_METRE: Final = 100
PER_METRE_COARSE: Final = 10
PER_MPS: Final = 100
PER_SECOND: Final = 100
PER_METRE_OF_OVERLAP: Final = 2

_HEAD = struct.Struct(">HHiHHB")
_STEP = struct.Struct(">iH")
_LOCATED = struct.Struct(">iH")
_LOCATED_AT = _HEAD.size + MOST_STEPS * _STEP.size
AUTHORITY_BYTES: Final = 32
_OVERLAP_AT = 31
_FORWARD, _STOP, _COUNT_SHIFT, _KNOWN, _RELEASE = 1, 2, 2, 16, 32


@dataclass(frozen=True, slots=True)
class LimitStep:
    """From a chainage on, in the direction of travel, another limit holds.

    Parameters
    ----------
    from_m : float
        Chainage, -1e6 to 1e6.
    limit_mps : float
        0 to 200.
    """

    from_m: float
    limit_mps: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_number("from_m", self.from_m, -FURTHEST_M, FURTHEST_M)
        check_number("limit_mps", self.limit_mps, 0.0, FASTEST_MPS)


@dataclass(frozen=True, slots=True)
class MovementAuthority:
    """Movement authority of one train.

    Parameters
    ----------
    train, segment : int
        Identities, 0 to 65535; chainages count on this segment.
    direction : int
        1 if the train travels towards greater chainages, -1 if towards smaller ones.
    end_of_authority_m : float
        Chainage that the front must not pass, -1e6 to 1e6.
    limit_mps : float
        Limit up to the first step, 0 to 200.
    validity_s : float
        Time from the time-stamp of the frame after which the authority is void, 0 to 600.
    steps : tuple of LimitStep
        At most two, in the order in which the train comes to them.
    emergency_stop : bool
        Whether the train must stop at once, whatever the rest says.
    located : (float, float), optional
        Where the front was at the time-stamp of the frame, by phase ranging, and the half-width of
        that interval at the integrity that the scenario states, 0 to 6553.5 [m].
    overlap_m : float
        From the end of authority to the danger point, 0 to 1e6; told up to 127.5.
    release : bool
        Whether the train may come to the end at a release speed, which it works out itself.

    Raises
    ------
    ValueError
        If a field is out of its range, or the steps are too many or out of order.

    Examples
    --------
    >>> authority = MovementAuthority(7, 2, -1, 1234.567, 20.0, 3.0)
    >>> MovementAuthority.from_bytes(authority.to_bytes()).end_of_authority_m
    1234.57
    """

    train: int
    segment: int
    direction: int
    end_of_authority_m: float
    limit_mps: float
    validity_s: float
    steps: tuple[LimitStep, ...] = ()
    emergency_stop: bool = False
    located: tuple[float, float] | None = None
    overlap_m: float = 0.0
    release: bool = False

    def __post_init__(self) -> None:
        """Check the ranges and the order of the steps."""
        check_identity("train", self.train)
        check_identity("segment", self.segment)
        check_direction(self.direction)
        check_number("end_of_authority_m", self.end_of_authority_m, -FURTHEST_M, FURTHEST_M)
        check_number("limit_mps", self.limit_mps, 0.0, FASTEST_MPS)
        check_number("validity_s", self.validity_s, 0.0, LONGEST_S)
        check_number("overlap_m", self.overlap_m, 0.0, FURTHEST_M)
        if self.located is not None:
            check_number("located", self.located[0], -FURTHEST_M, FURTHEST_M)
            check_number("located", self.located[1], 0.0, WIDEST_M)
        if len(self.steps) > MOST_STEPS:
            raise ValueError(f"steps must be at most {MOST_STEPS}, got {len(self.steps)}")
        for one, other in zip(self.steps, self.steps[1:], strict=False):
            if self.direction * (other.from_m - one.from_m) <= 0.0:
                raise ValueError(
                    f"steps must be in the order of travel, got {one.from_m!r} m before"
                    f" {other.from_m!r} m in direction {self.direction}"
                )

    def limit_at(self, chainage_m: float) -> float:
        """Limit [m/s] at a chainage, steps included; the end is not looked at."""
        limit_mps = self.limit_mps
        for step in self.steps:
            if self.direction * (chainage_m - step.from_m) < 0.0:
                break
            limit_mps = step.limit_mps
        return limit_mps

    def to_bytes(self) -> bytes:
        """Bytes on the wire."""
        steps = self._steps_on_the_wire()
        flags = len(steps) << _COUNT_SHIFT
        flags |= (_FORWARD if self.direction > 0 else 0) | (_STOP if self.emergency_stop else 0)
        located = self._located_on_the_wire()
        flags |= (_KNOWN if located else 0) | (_RELEASE if self.release else 0)
        head = _HEAD.pack(
            self.train,
            self.segment,
            self.direction * down(self.direction * self.end_of_authority_m, PER_METRE),
            down(self.limit_mps, PER_MPS),
            down(self.validity_s, PER_SECOND),
            flags,
        )
        body = (head + b"".join(_STEP.pack(*step) for step in steps)).ljust(_LOCATED_AT, b"\0")
        overlap = down(min(self.overlap_m, LONGEST_OVERLAP_M), PER_METRE_OF_OVERLAP)
        return body + _LOCATED.pack(*(located or (0, 0))) + bytes([overlap])

    def _located_on_the_wire(self) -> tuple[int, int] | None:
        if self.located is None:
            return None
        place, half = covering(*self.located, PER_METRE, PER_METRE_COARSE)
        return (place, half) if half <= 0xFFFF else None

    def _steps_on_the_wire(self) -> list[tuple[int, int]]:
        kept: list[tuple[int, int]] = []
        before_mps = self.limit_mps
        for at, step in enumerate(self.steps):
            along_m = self.direction * step.from_m
            rises = step.limit_mps > before_mps
            if rises and at + 1 < len(self.steps):
                following_m = self.direction * self.steps[at + 1].from_m
                if down(following_m, PER_METRE) < up(along_m, PER_METRE):
                    # Rounded apart, this step and the next would change places: go without.
                    continue
            place = self.direction * (up if rises else down)(along_m, PER_METRE)
            if kept and kept[-1][0] == place:
                kept.pop()
            kept.append((place, down(step.limit_mps, PER_MPS)))
            before_mps = step.limit_mps
        return kept

    @classmethod
    def from_bytes(cls, raw: bytes) -> MovementAuthority:
        """Authority of the bytes on the wire.

        Raises
        ------
        ValueError
            If they are not an authority.
        """
        if len(raw) != AUTHORITY_BYTES:
            raise ValueError(f"a movement authority has {AUTHORITY_BYTES} bytes, got {len(raw)}")
        train, segment, end, limit, validity, flags = _HEAD.unpack_from(raw)
        count = flags >> _COUNT_SHIFT & 3
        used = _HEAD.size + min(count, MOST_STEPS) * _STEP.size
        known = bool(flags & _KNOWN)
        unused = raw[used:_LOCATED_AT] + (b"" if known else raw[_LOCATED_AT:_OVERLAP_AT])
        if count > MOST_STEPS or flags >= 2 * _RELEASE or any(unused):
            raise ValueError(f"not a movement authority: {count} steps, rest {raw[used:].hex()}")
        steps = (_STEP.unpack_from(raw, at) for at in range(_HEAD.size, used, _STEP.size))
        return cls(
            train,
            segment,
            1 if flags & _FORWARD else -1,
            end / PER_METRE,
            limit / PER_MPS,
            validity / PER_SECOND,
            tuple(LimitStep(place / PER_METRE, mps / PER_MPS) for place, mps in steps),
            bool(flags & _STOP),
            _located_of(raw) if known else None,
            raw[_OVERLAP_AT] / PER_METRE_OF_OVERLAP,
            bool(flags & _RELEASE),
        )


def _located_of(raw: bytes) -> tuple[float, float]:
    place, half = _LOCATED.unpack_from(raw, _LOCATED_AT)
    return place / PER_METRE, half / PER_METRE_COARSE
