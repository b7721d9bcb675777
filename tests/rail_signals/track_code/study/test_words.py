"""Random words are words of the profile, and the check of arrays is that of one word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.study.words import CheckedWords
from rail_signals.track_code.word import decode, encode

PROFILE = load_profile("tones27")
WORDS = CheckedWords(PROFILE)


def test_what_is_drawn_are_words_of_all_fields() -> None:
    drawn = WORDS.draw(np.random.default_rng(1), 500)
    assert drawn.shape == (500, PROFILE.tones)
    assert WORDS.pass_check(drawn).all()
    for word in drawn:
        fields = decode(PROFILE, word)
        assert fields is not None
        assert np.array_equal(encode(PROFILE, fields), word)
    assert drawn.mean(axis=0) == pytest.approx(np.full(PROFILE.tones, 0.5), abs=0.1)


def test_one_wrong_bit_never_passes() -> None:
    drawn = WORDS.draw(np.random.default_rng(2), 200)
    flipped = drawn[:, None, :] ^ np.eye(PROFILE.tones, dtype=np.bool_)
    assert not WORDS.pass_check(flipped).any()


def test_the_check_is_that_of_the_receiver() -> None:
    bits = np.random.default_rng(3).integers(0, 2, (2000, PROFILE.tones)).astype(np.bool_)
    bits[0] = False
    expected = [decode(PROFILE, each) is not None for each in bits]
    assert any(expected)
    assert WORDS.pass_check(bits).tolist() == expected


def test_random_bits_pass_once_in_two_to_the_number_of_checks() -> None:
    bits = np.random.default_rng(4).integers(0, 2, (200_000, PROFILE.tones))
    passed = int(np.count_nonzero(WORDS.pass_check(bits)))
    assert binomtest(passed, len(bits), WORDS.pass_rate).pvalue > 1e-3


def test_a_profile_that_a_bare_carrier_passes_is_refused() -> None:
    with pytest.raises(ValueError, match="crc_inversion 0"):
        CheckedWords(replace(PROFILE, crc_inversion=0))
    with pytest.raises(ValueError, match="crc_polynomial 0"):
        CheckedWords(load_profile("tones18"))
