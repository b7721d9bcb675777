"""Words of a track code: the fields of a message as bits, one per tone, with a CRC.

The check field ends the word. It is the remainder of the message polynomial times ``x^r``
by the generator of degree r, XORed with the profile's inversion. The generator of the
27-tone profile, ours, is ``(x + 1)(x^5 + x^2 + 1)``: up to 31 bits its words differ from
each other in four places or more, so one, two or three wrong bits never pass.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import BoolArray

from .profile import CRC_FIELD, TrackCodeProfile


def crc(polynomial: int, message: int) -> int:
    """Remainder of ``message * x^r`` by a generator of degree r over GF(2).

    Examples
    --------
    >>> crc(0b1011, 0b1101)
    1
    """
    degree = polynomial.bit_length() - 1
    rest = message << degree
    while rest.bit_length() > degree:
        rest ^= polynomial << (rest.bit_length() - 1 - degree)
    return rest


def encode(profile: TrackCodeProfile, fields: Mapping[str, int]) -> BoolArray:
    """Bits of a message.

    Parameters
    ----------
    profile
        Fields and coding.
    fields
        Value of every field but the check field.

    Returns
    -------
    bool [tones]
        Which tones are sent; tone 0 is the least significant bit of the word.

    Raises
    ------
    ValueError
        If a field is missing, unknown or too large, or if no tone would be sent.

    Examples
    --------
    >>> from rail_signals.track_code.profile import load_profile
    >>> encode(load_profile("three_tones"), {"tone_30_hz": 1, "tone_25_hz": 0, "tone_20_hz": 1})
    array([ True, False,  True])
    """
    wanted = [(name, bits) for name, bits in profile.fields if name != CRC_FIELD]
    if set(fields) != {name for name, _ in wanted}:
        raise ValueError(f"fields must be {[name for name, _ in wanted]}, got {sorted(fields)}")
    word = 0
    for name, bits in wanted:
        value = fields[name]
        limit = profile.tones if profile.coding == "one_of_n" else 2**bits
        if isinstance(value, bool) or value != int(value) or not 0 <= value < limit:
            raise ValueError(f"{name} must be an integer from 0 to {limit - 1}, got {value!r}")
        word = word << bits | int(value)
    if profile.coding == "one_of_n":
        return np.array([i == word for i in range(profile.tones)])
    if profile.crc_polynomial:
        check = crc(profile.crc_polynomial, word) ^ profile.crc_inversion
        word = word << (profile.crc_polynomial.bit_length() - 1) | check
    if not word:
        raise ValueError(f"fields must send a tone at least, got {dict(fields)}")
    return np.array([bool(word >> i & 1) for i in range(profile.tones)])


def decode(profile: TrackCodeProfile, bits: ArrayLike) -> dict[str, int] | None:
    """Message of the bits of a word.

    Parameters
    ----------
    profile
        Fields and coding.
    bits : bool [tones]
        Which tones are present.

    Returns
    -------
    dict or None
        Value of every field but the check field; None if the check fails, if no tone is
        present, or if it is not exactly one where only one may be.

    Raises
    ------
    ValueError
        If the shape or type of `bits` is wrong.

    Examples
    --------
    >>> from rail_signals.track_code.profile import load_profile
    >>> profile = load_profile("tones18")
    >>> decode(profile, encode(profile, {"tone": 7}))
    {'tone': 7}
    """
    present = np.asarray(bits)
    if present.shape != (profile.tones,) or present.dtype != np.bool_:
        raise ValueError(
            f"bits must be {profile.tones} truth values, got {present.dtype}"
            f" of shape {present.shape}"
        )
    if profile.coding == "one_of_n":
        (number,) = np.nonzero(present)
        return {profile.fields[0][0]: int(number[0])} if number.size == 1 else None
    word = sum(1 << int(i) for i in np.flatnonzero(present))
    if not word:
        return None
    if profile.crc_polynomial:
        degree = profile.crc_polynomial.bit_length() - 1
        check = (word & ((1 << degree) - 1)) ^ profile.crc_inversion
        if crc(profile.crc_polynomial, word >> degree) != check:
            return None
    fields: dict[str, int] = {}
    for name, width in reversed(profile.fields):
        if name != CRC_FIELD:
            fields[name] = word & ((1 << width) - 1)
        word >>= width
    return {name: fields[name] for name, _ in profile.fields if name != CRC_FIELD}


def as_number(bits: ArrayLike) -> int:
    """The word as a number; tone 0 is the least significant bit.

    Examples
    --------
    >>> as_number([False, True, True])
    6
    """
    return sum(1 << int(i) for i in np.flatnonzero(np.asarray(bits)))
