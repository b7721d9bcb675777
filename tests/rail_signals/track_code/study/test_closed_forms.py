"""Closed forms: where curves cross a rate, and what passes unnoticed."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from rail_signals.track_code.bound import tone_covariance_bound
from rail_signals.track_code.profile import TrackCodeProfile, load_profile
from rail_signals.track_code.study.baseband import RATE_HZ, slot_samples, snr_of
from rail_signals.track_code.study.closed_forms import (
    density_at,
    density_of_message_error,
    loss_db,
    message_error_rate,
    thresholds_hz,
    undetected_rate,
)
from rail_signals.track_code.study.words import CheckedWords

PROFILE = load_profile("tones27")
#: So few bits and checks that wrong messages pass often enough to be counted, and a slot so long
#: that the tones are orthogonal in it, which the closed form takes for granted.
SMALL = TrackCodeProfile(
    name="small",
    coding="on_off",
    tones_hz=tuple(2.0 + 0.64 * k for k in range(6)),
    deviations_hz=tuple(0.45 * (2.0 + 0.64 * k) for k in range(6)),
    carriers_hz=(1700.0,),
    fields=(("field", 3), ("crc", 3)),
    crc_polynomial=0b1011,
    slot_samples=1040,
    short_slot_samples=32,
    absent_max=0.74,
    present_min=0.76,
    present_max=2.0,
    source="made up",
    crc_inversion=0b111,
)
DEVIATIONS_HZ = np.array(SMALL.deviations_hz)


def test_the_bound_of_the_document() -> None:
    assert density_of_message_error(PROFILE, 1e-2) == pytest.approx(21.93, abs=0.005)
    at = density_of_message_error(PROFILE, 3e-4)
    assert message_error_rate(PROFILE, at) == pytest.approx(3e-4, rel=1e-4)


@pytest.mark.parametrize("density_db_hz", [15.0, 40.0, 60.0])
def test_thresholds_lie_between_nothing_and_the_tone(density_db_hz: float) -> None:
    levels_hz = thresholds_hz(PROFILE, density_db_hz)
    deviations_hz = np.array(PROFILE.deviations_hz)
    assert (levels_hz > 0.49 * deviations_hz).all()
    assert (levels_hz < 1.2 * deviations_hz).all()
    assert 0.0 <= message_error_rate(PROFILE, density_db_hz) <= 1.0


def test_a_curve_beside_the_bound_loses_by_how_much_it_is_beside() -> None:
    densities = np.arange(20.0, 28.0)
    for shift_db in (0.0, 1.3, 3.0):
        points = [(float(d), message_error_rate(PROFILE, float(d) - shift_db)) for d in densities]
        # Straight lines between points 1 dB apart are off by a few hundredths.
        assert loss_db(PROFILE, points) == pytest.approx(shift_db, abs=0.06)


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([(20.0, 1.0), (22.0, 1e-1), (24.0, 1e-3)], 23.0),
        ([(20.0, 1e-1), (21.0, 0.0)], 21.0),
        ([(20.0, 1e-2), (21.0, 1e-2)], 20.0),
        ([(20.0, 1.0), (21.0, 0.5)], None),
        ([(20.0, 1e-3), (21.0, 1e-4)], None),
        ([], None),
    ],
)
def test_where_a_curve_crosses_a_rate(
    points: list[tuple[float, float]], expected: float | None
) -> None:
    assert density_at(points, 1e-2) == (None if expected is None else pytest.approx(expected))
    if expected is None:
        assert loss_db(PROFILE, points) is None


def test_wrong_messages_of_efficient_levels_pass_as_often_as_is_predicted() -> None:
    density_db_hz, trials = 2.0, 100_000
    rng = np.random.default_rng(5)
    words = CheckedWords(SMALL)
    sent = words.draw(rng, trials)
    covariance = tone_covariance_bound(
        SMALL.tones_hz, snr_of(density_db_hz), slot_samples(SMALL), RATE_HZ
    )
    root = np.linalg.cholesky(covariance)
    true = sent * DEVIATIONS_HZ * np.exp(2j * np.pi * rng.uniform(size=sent.shape))
    error_hz = (rng.normal(size=(trials, len(root))) @ root.T).reshape(trials, 2, -1)
    levels = np.abs(true + error_hz[:, 0] - 1j * error_hz[:, 1]) / DEVIATIONS_HZ
    bits = levels >= SMALL.present_min
    clear = (levels <= SMALL.absent_max) | (bits & (levels <= SMALL.present_max))
    passed = clear.all(axis=-1) & words.pass_check(bits)
    wrong = int(np.count_nonzero(passed & (bits != sent).any(axis=-1)))
    assert binomtest(wrong, trials, undetected_rate(SMALL, density_db_hz)).pvalue > 1e-3


def test_none_of_27_tones_passes_unnoticed_where_half_are_lost() -> None:
    assert undetected_rate(PROFILE, 30.4) < 1e-15
