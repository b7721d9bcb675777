"""What one family of audio-tone track codes looks like: tones, fields, windows.

A profile is data: it is read from a JSON file of the package and never changed. What the
public sources do not tell is chosen here and named in `TrackCodeProfile.unconfirmed`.

====================  ==========================================================
``F_i``               frequency of tone i [Hz]; bit i of a word tells if it is sent
``A_i``               peak frequency deviation that tone i causes [Hz]
``f_o``               carrier frequency [Hz]
``b_i``               1 if tone i is present, else 0
====================  ==========================================================

The symbols are those of Kim, Lim, Kim and Cho, "The Analysis of Railway signal using DSP",
equations 1-3.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

CODINGS = ("on_off", "one_of_n")
"""Every tone is a bit, or the one tone present is the message."""

SLOT_RATE_HZ = 64.0
"""Sample rate at which slots are counted and tones are measured [Hz]."""

CRC_FIELD = "crc"
"""Name of the field that holds the check bits; the last one where there is a polynomial."""


@dataclass(frozen=True)
class TrackCodeProfile:
    """Tones, fields and receiver windows of one track-code family.

    Parameters
    ----------
    name
        Name of the profile.
    coding
        ``on_off`` (each tone is one bit) or ``one_of_n`` (exactly one tone is present and
        its number is the message).
    tones_hz
        Tone frequencies F_i [Hz], rising, below half of the 64 Hz slot rate.
    deviations_hz
        Peak frequency deviation A_i of each tone [Hz].
    carriers_hz
        Carrier frequencies f_o the family uses [Hz].
    fields
        ``(name, bits)`` of each field, most significant first; the last is ``crc`` where
        `crc_polynomial` is not zero. Tone 0 carries the least significant bit of the word.
        ``one_of_n`` has one field, the number of the tone.
    crc_polynomial
        Generator polynomial with its leading term, bit k being the factor of x^k; 0: none.
    slot_samples
        Samples at 64 Hz of the long slot, the one that decides.
    short_slot_samples
        Samples at 64 Hz of the short slot, the one that notices a change.
    absent_max, present_min, present_max
        A tone is absent up to the first and present from the second to the third level,
        each a fraction of its nominal deviation; any other level is no decision.
    source
        Where the family is described.
    unconfirmed
        What is chosen here because no public source tells, one sentence each.
    crc_inversion
        Pattern XORed onto the check bits, so that a bare carrier is no message.

    Raises
    ------
    ValueError
        If a field is out of range; the message names the field and quotes the value.
    """

    name: str
    coding: str
    tones_hz: tuple[float, ...]
    deviations_hz: tuple[float, ...]
    carriers_hz: tuple[float, ...]
    fields: tuple[tuple[str, int], ...]
    crc_polynomial: int
    slot_samples: int
    short_slot_samples: int
    absent_max: float
    present_min: float
    present_max: float
    source: str
    unconfirmed: tuple[str, ...] = ()
    crc_inversion: int = 0

    def __post_init__(self) -> None:
        """Coerce sequences to tuples and validate every field."""
        for name in ("tones_hz", "deviations_hz", "carriers_hz"):
            value = tuple(float(v) for v in getattr(self, name))
            object.__setattr__(self, name, value)
            if not value or not all(math.isfinite(v) and v > 0 for v in value):
                raise ValueError(f"{name} must hold finite values above zero, got {value}")
        object.__setattr__(self, "fields", tuple((str(n), b) for n, b in self.fields))
        object.__setattr__(self, "unconfirmed", tuple(str(u) for u in self.unconfirmed))
        if self.coding not in CODINGS:
            raise ValueError(f"coding must be one of {CODINGS}, got {self.coding!r}")
        if list(self.tones_hz) != sorted(set(self.tones_hz)):
            raise ValueError(f"tones_hz must rise, got {self.tones_hz}")
        if self.tones_hz[-1] >= SLOT_RATE_HZ / 2:
            raise ValueError(f"tones_hz must stay below {SLOT_RATE_HZ / 2} Hz, got {self.tones_hz}")
        if len(self.deviations_hz) != len(self.tones_hz):
            raise ValueError(
                f"deviations_hz must hold one value per tone ({len(self.tones_hz)}),"
                f" got {self.deviations_hz}"
            )
        self._check_fields()
        self._check_receiver()

    @property
    def tones(self) -> int:
        """Number of tones, which is the number of bits of a word."""
        return len(self.tones_hz)

    @property
    def peak_deviation_hz(self) -> float:
        """Largest distance from the carrier that any word can cause [Hz]."""
        return max(self.deviations_hz) if self.coding == "one_of_n" else sum(self.deviations_hz)

    @property
    def slot_s(self) -> float:
        """Length of the long slot [s]."""
        return self.slot_samples / SLOT_RATE_HZ

    def _check_fields(self) -> None:
        """Reject fields that do not fit the tones or the polynomial."""
        names = [name for name, _ in self.fields]
        bits = [b for _, b in self.fields]
        if not names or len(set(names)) != len(names) or "" in names:
            raise ValueError(f"fields must have distinct names, got {self.fields}")
        if any(not _is_int(b) or b < 1 for b in bits):
            raise ValueError(f"fields must have one bit or more each, got {self.fields}")
        if self.coding == "one_of_n":
            if len(bits) != 1 or 2 ** bits[0] < self.tones:
                raise ValueError(
                    f"fields must be one that counts {self.tones} tones, got {self.fields}"
                )
        elif sum(bits) != self.tones:
            raise ValueError(f"fields must hold {self.tones} bits in all, got {self.fields}")
        polynomial = self.crc_polynomial
        if not _is_int(polynomial) or polynomial < 0 or polynomial == 1:
            raise ValueError(f"crc_polynomial must be 0 or of degree 1 or more, got {polynomial!r}")
        if (polynomial != 0) != (CRC_FIELD in names) or (polynomial and names[-1] != CRC_FIELD):
            raise ValueError(
                f"fields must end with {CRC_FIELD!r} exactly where crc_polynomial is not 0,"
                f" got {self.fields}"
            )
        if polynomial and polynomial.bit_length() - 1 != bits[-1]:
            raise ValueError(
                f"crc_polynomial must be of degree {bits[-1]}, the bits of the last field,"
                f" got {polynomial:#b}"
            )
        width = bits[-1] if polynomial else 0
        if not _is_int(self.crc_inversion) or not 0 <= self.crc_inversion < 2**width:
            raise ValueError(
                f"crc_inversion must fit into {width} check bits, got {self.crc_inversion!r}"
            )

    def _check_receiver(self) -> None:
        """Reject slots that cannot resolve the tones and windows that overlap."""
        spacing = min(
            (b - a for a, b in zip(self.tones_hz, self.tones_hz[1:], strict=False)),
            default=self.tones_hz[0],
        )
        # Kim et al., equation 8; the tolerance forgives 0.64 Hz as a difference of floats.
        least = math.ceil(SLOT_RATE_HZ / spacing - 1e-6)
        if not _is_int(self.slot_samples) or self.slot_samples < least:
            raise ValueError(
                f"slot_samples must be {least} or more to tell tones {spacing:.3g} Hz apart,"
                f" got {self.slot_samples!r}"
            )
        short = self.short_slot_samples
        if not _is_int(short) or not 1 <= short < self.slot_samples:
            raise ValueError(
                f"short_slot_samples must lie between 1 and slot_samples, got {short!r}"
            )
        windows = (self.absent_max, self.present_min, self.present_max)
        if not all(math.isfinite(w) for w in windows) or not 0 < windows[0] < windows[1] < 1:
            raise ValueError(
                "absent_max and present_min must rise between 0 and 1,"
                f" got {self.absent_max!r} and {self.present_min!r}"
            )
        if not self.present_max > 1:
            raise ValueError(f"present_max must be above 1, got {self.present_max!r}")


def profile_names() -> tuple[str, ...]:
    """Names of the profiles of the package, in alphabetical order.

    Examples
    --------
    >>> profile_names()
    ('three_tones', 'tones18', 'tones27')
    """
    entries = (files("rail_signals.track_code") / "profiles").iterdir()
    return tuple(sorted(e.name[: -len(".json")] for e in entries if e.name.endswith(".json")))


def load_profile(name: str) -> TrackCodeProfile:
    """Read one profile of the package.

    Raises
    ------
    ValueError
        If there is no profile of that name.

    Examples
    --------
    >>> load_profile("tones27").tones
    27
    """
    if name not in profile_names():
        raise ValueError(f"name must be one of {profile_names()}, got {name!r}")
    text = (files("rail_signals.track_code") / "profiles" / f"{name}.json").read_text(
        encoding="utf-8"
    )
    values: dict[str, Any] = json.loads(text)
    return TrackCodeProfile(**values)


def _is_int(value: object) -> bool:
    """Whether a value is an integer and not a truth value."""
    return isinstance(value, int) and not isinstance(value, bool)
