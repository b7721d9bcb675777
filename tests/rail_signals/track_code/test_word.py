"""Words of track codes: round trips, and corruption that never passes."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.word import crc, decode, encode

TONES27 = load_profile("tones27")
MESSAGE = {"speed": 300 // 2, "gradient": 5, "block_length": 30, "network": 4}


@given(st.integers(0, 255), st.integers(0, 15), st.integers(0, 63), st.integers(0, 7))
def test_round_trip(speed: int, gradient: int, block_length: int, network: int) -> None:
    fields = {
        "speed": speed,
        "gradient": gradient,
        "block_length": block_length,
        "network": network,
    }
    assert decode(TONES27, encode(TONES27, fields)) == fields


@pytest.mark.parametrize("fields", [MESSAGE, dict.fromkeys(MESSAGE, 0)])
def test_one_two_or_three_wrong_bits_never_pass(fields: dict[str, int]) -> None:
    word = encode(TONES27, fields)
    corrupted = 0
    for count in (1, 2, 3):
        for places in combinations(range(27), count):
            wrong = word.copy()
            wrong[list(places)] ^= True
            assert decode(TONES27, wrong) is None
            corrupted += 1
    assert corrupted == 27 + 351 + 2925


def test_the_code_is_linear_so_distance_is_weight() -> None:
    # No pattern of one to three places is a multiple of the generator: then it passes on no word.
    syndromes = [crc(TONES27.crc_polynomial, 1 << place) for place in range(21)]
    syndromes += [1 << place for place in range(6)]
    assert 0 not in syndromes
    for count in (2, 3):
        for places in combinations(syndromes, count):
            assert np.bitwise_xor.reduce(places) != 0


def test_the_fields_lie_most_significant_first() -> None:
    bits = encode(TONES27, {"speed": 128, "gradient": 0, "block_length": 0, "network": 1})
    assert bits[26] and bits[6]
    assert not bits[7:26].any()


def test_a_bare_carrier_or_all_tones_are_no_message() -> None:
    for name in ("tones27", "tones18", "three_tones"):
        profile = load_profile(name)
        assert decode(profile, np.zeros(profile.tones, dtype=bool)) is None
    assert decode(TONES27, np.ones(27, dtype=bool)) is None


def test_one_of_n() -> None:
    profile = load_profile("tones18")
    for tone in range(18):
        bits = encode(profile, {"tone": tone})
        assert bits.sum() == 1 and bits[tone]
        assert decode(profile, bits) == {"tone": tone}
    bits[0] = True
    assert decode(profile, bits) is None
    with pytest.raises(ValueError, match="tone must be an integer from 0 to 17, got 18"):
        encode(profile, {"tone": 18})


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="speed must be an integer from 0 to 255, got 256"):
        encode(TONES27, MESSAGE | {"speed": 256})
    with pytest.raises(ValueError, match="speed must be an integer"):
        encode(TONES27, MESSAGE | {"speed": True})
    with pytest.raises(ValueError, match=r"fields must be .*got .*'crc'"):
        encode(TONES27, MESSAGE | {"crc": 1})
    with pytest.raises(ValueError, match="fields must send a tone"):
        encode(
            load_profile("three_tones"),
            dict.fromkeys(("tone_30_hz", "tone_25_hz", "tone_20_hz"), 0),
        )
    with pytest.raises(ValueError, match="27 truth values, got int"):
        decode(TONES27, np.zeros(27, dtype=int))
    with pytest.raises(ValueError, match=r"27 truth values, got bool of shape \(26,\)"):
        decode(TONES27, np.zeros(26, dtype=bool))
