"""Profiles of track codes: the figures of the families, and what is refused."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from rail_signals.track_code.profile import TrackCodeProfile, load_profile, profile_names

TONES27 = load_profile("tones27")


def test_the_27_tones() -> None:
    assert TONES27.tones == 27
    np.testing.assert_allclose(TONES27.tones_hz, 0.88 + 0.64 * np.arange(27))
    assert TONES27.tones_hz[-1] == 17.52
    assert TONES27.carriers_hz == (1700, 2000, 2300, 2600)
    assert [bits for _, bits in TONES27.fields] == [8, 4, 6, 3, 6]
    assert TONES27.peak_deviation_hz < 150
    # The floor that the spacing sets (equation 8): 100 samples at 64 Hz.
    assert TONES27.slot_s >= 1.5625
    assert any("CRC" in line for line in TONES27.unconfirmed)


def test_the_18_tones_and_the_three() -> None:
    tones18 = load_profile("tones18")
    assert tones18.tones == 18
    np.testing.assert_allclose(tones18.tones_hz, 10.3 + 1.1 * np.arange(18))
    assert tones18.coding == "one_of_n"
    assert tones18.peak_deviation_hz == 11.0
    assert load_profile("three_tones").tones_hz == (20.0, 25.0, 30.0)


def test_every_profile_loads_and_owns_up() -> None:
    for name in profile_names():
        profile = load_profile(name)
        assert profile.name == name
        assert profile.unconfirmed and profile.source
    with pytest.raises(ValueError, match=r"name must be one of .*'tones19'"):
        load_profile("tones19")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coding": "morse"}, "coding must be one of .*'morse'"),
        ({"tones_hz": ()}, "tones_hz must hold finite"),
        ({"tones_hz": TONES27.tones_hz[::-1]}, "tones_hz must rise"),
        ({"tones_hz": (*TONES27.tones_hz[:-1], 32.0)}, "tones_hz must stay below 32"),
        ({"tones_hz": (*TONES27.tones_hz[:-1], 17.0)}, "slot_samples must be 534 or more"),
        ({"deviations_hz": (1.0,)}, "deviations_hz must hold one value per tone"),
        ({"deviations_hz": (float("nan"),) * 27}, "deviations_hz must hold finite"),
        ({"carriers_hz": (0.0,)}, "carriers_hz must hold finite"),
        ({"fields": (("speed", 21), ("crc", 5))}, "fields must hold 27 bits"),
        ({"fields": (("a", 21), ("a", 6))}, "fields must have distinct names"),
        ({"fields": (("a", 27), ("crc", 0))}, "fields must have one bit or more"),
        ({"fields": (("crc", 6), ("a", 21))}, "fields must end with 'crc'"),
        ({"crc_polynomial": 0}, "fields must end with 'crc' exactly where"),
        ({"crc_polynomial": 1}, "crc_polynomial must be 0 or of degree 1"),
        ({"crc_polynomial": 0b1011}, "crc_polynomial must be of degree 6"),
        ({"crc_inversion": 64}, "crc_inversion must fit into 6"),
        ({"slot_samples": 99}, "slot_samples must be 100 or more"),
        ({"slot_samples": 104.0}, "slot_samples must be 100 or more"),
        ({"short_slot_samples": 104}, "short_slot_samples must lie"),
        ({"absent_max": 0.7}, "absent_max and present_min must rise"),
        ({"present_max": 1.0}, "present_max must be above 1"),
        ({"coding": "one_of_n"}, "fields must be one that counts 27"),
    ],
)
def test_what_a_profile_refuses(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(TONES27, **changes)


def test_equation_8_accepts_the_floor_itself() -> None:
    assert dataclasses.replace(TONES27, slot_samples=100).slot_s == 1.5625


def test_sequences_become_tuples() -> None:
    values = dataclasses.asdict(TONES27)
    values["tones_hz"] = list(TONES27.tones_hz)
    values["fields"] = [list(field) for field in TONES27.fields]
    assert TrackCodeProfile(**values) == TONES27
