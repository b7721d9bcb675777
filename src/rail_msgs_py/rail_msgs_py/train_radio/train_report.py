"""Location report: where a train says it is (the train location of IEEE 1474.1).

Layout, 16 bytes, big endian:

====== ===== ============================================================== ==========
offset bytes field                                                          resolution
====== ===== ============================================================== ==========
0      2     train
2      2     segment
4      4     offset of the front, signed                                    0.01 m
8      2     speed                                                          0.01 m/s
10     2     uncertainty                                                    0.1 m
12     2     length                                                         0.1 m
14     1     flags: 1 towards greater offsets, 2 integrity confirmed,
             4 position valid, 8 released to run on sight; the others are
             zero
15     1     zero
====== ===== ============================================================== ==========

Who reads a report never believes the train to be shorter, slower or better located than who
wrote it: the offset goes to the nearest step, and the uncertainty, rounded up, covers that
rounding too; length and speed are rounded up. An uncertainty that the field cannot hold makes
the position invalid. (The rear follows from offset, uncertainty and length alone: a speed must
not be used to move it on.)
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

from .fixed_point import check_direction, check_identity, check_number, covering, up

FURTHEST_M: Final = 1e6
FASTEST_MPS: Final = 200.0
LONGEST_TRAIN_M: Final = 6000.0
WIDEST_M: Final = 6553.5

PER_METRE: Final = 100
PER_METRE_COARSE: Final = 10
PER_MPS: Final = 100

_LAYOUT = struct.Struct(">HHiHHHBx")
REPORT_BYTES: Final = _LAYOUT.size
_FORWARD, _INTEGRITY, _VALID, _ON_SIGHT = 1, 2, 4, 8
_FLAGS = _FORWARD | _INTEGRITY | _VALID | _ON_SIGHT
_MOST = 0xFFFF


@dataclass(frozen=True, slots=True)
class LocationReport:
    """Location report of one train, true at the time-stamp of the frame that carries it.

    Parameters
    ----------
    train, segment : int
        Identities, 0 to 65535.
    offset_m : float
        Chainage of the front on the segment, -1e6 to 1e6.
    direction : int
        1 if the train faces greater offsets, -1 if smaller ones.
    speed_mps : float
        Magnitude, 0 to 200.
    uncertainty_m : float
        Half-width of the front's interval at the integrity that the scenario states, the age of
        the measurement at the time-stamp included; 0 to 6553.5.
    length_m : float
        Of the train, above 0, at most 6000.
    integrity_confirmed : bool
        Whether the train knows itself to be whole.
    position_valid : bool
        Whether segment, offset, direction and uncertainty mean anything.
    on_sight : bool
        Whether a person has released the train to run on sight: it may pass its authority.

    Raises
    ------
    ValueError
        If a field is out of its range.

    Examples
    --------
    >>> report = LocationReport(7, 2, 1234.567, 1, 20.0, 3.0, 160.0, True, True)
    >>> read = LocationReport.from_bytes(report.to_bytes())
    >>> read.offset_m, read.uncertainty_m
    (1234.57, 3.1)
    """

    train: int
    segment: int
    offset_m: float
    direction: int
    speed_mps: float
    uncertainty_m: float
    length_m: float
    integrity_confirmed: bool
    position_valid: bool
    on_sight: bool = False

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_identity("train", self.train)
        check_identity("segment", self.segment)
        check_number("offset_m", self.offset_m, -FURTHEST_M, FURTHEST_M)
        check_direction(self.direction)
        check_number("speed_mps", self.speed_mps, 0.0, FASTEST_MPS)
        check_number("uncertainty_m", self.uncertainty_m, 0.0, WIDEST_M)
        check_number("length_m", self.length_m, 0.0, LONGEST_TRAIN_M)
        if self.length_m == 0.0:
            raise ValueError(f"length_m must be above 0, got {self.length_m!r}")

    @property
    def front_m(self) -> float:
        """Furthest chainage, in the direction of travel, at which the front may be."""
        return self.offset_m + self.direction * self.uncertainty_m

    @property
    def rear_m(self) -> float:
        """Hindmost chainage, against the direction of travel, at which the rear may be."""
        return self.offset_m - self.direction * (self.uncertainty_m + self.length_m)

    def to_bytes(self) -> bytes:
        """Bytes on the wire."""
        offset, uncertainty = covering(
            self.offset_m, self.uncertainty_m, PER_METRE, PER_METRE_COARSE
        )
        valid = self.position_valid and uncertainty <= _MOST
        return _LAYOUT.pack(
            self.train,
            self.segment,
            offset,
            up(self.speed_mps, PER_MPS),
            min(uncertainty, _MOST),
            up(self.length_m, PER_METRE_COARSE),
            (_FORWARD if self.direction > 0 else 0)
            | (_INTEGRITY if self.integrity_confirmed else 0)
            | (_VALID if valid else 0)
            | (_ON_SIGHT if self.on_sight else 0),
        )

    @classmethod
    def from_bytes(cls, raw: bytes) -> LocationReport:
        """Report of the bytes on the wire.

        Raises
        ------
        ValueError
            If they are not a report.
        """
        if len(raw) != REPORT_BYTES:
            raise ValueError(f"a location report has {REPORT_BYTES} bytes, got {len(raw)}")
        train, segment, offset, speed, uncertainty, length, flags = _LAYOUT.unpack(raw)
        if flags > _FLAGS or raw[-1]:
            raise ValueError(f"not a location report: flags {flags:#04x}, last byte {raw[-1]}")
        return cls(
            train,
            segment,
            offset / PER_METRE,
            1 if flags & _FORWARD else -1,
            speed / PER_MPS,
            uncertainty / PER_METRE_COARSE,
            length / PER_METRE_COARSE,
            bool(flags & _INTEGRITY),
            bool(flags & _VALID),
            bool(flags & _ON_SIGHT),
        )
