"""What a transponder may return: each limit from either side."""

from __future__ import annotations

import math

import pytest

from rail_onboard.ranging.downlink_check import DownlinkCheck
from rail_signals.ranging.interference import CHI_SQUARE_LIMIT, JAMMING_LIMIT_DB, RESIDUAL_FRACTION

NOISE_MW, SAMPLES = 1e-10, 960
CHECK = DownlinkCheck(NOISE_MW, SAMPLES)


@pytest.mark.parametrize(("beyond_db", "told"), [(-0.01, ""), (0.01, "channel jammed")])
@pytest.mark.parametrize("snr", [1.0, 1000.0])
def test_noise_is_a_jammer_from_six_decibels_on(snr: float, beyond_db: float, told: str) -> None:
    noise_mw = NOISE_MW * 10.0 ** (0.1 * (6.0 + beyond_db))
    assert JAMMING_LIMIT_DB == 6.0
    found = CHECK.disturbance(amplitude=math.sqrt(noise_mw * snr), snr=snr, reduced_chi_square=1.0)
    assert found == told


def test_where_no_noise_is_expected_jamming_is_not_looked_for() -> None:
    check = DownlinkCheck(math.inf, SAMPLES)
    assert check.disturbance(amplitude=1.0, snr=1e-3, reduced_chi_square=1.0) == ""


@pytest.mark.parametrize(("misfit", "told"), [(5.99, ""), (6.01, "hears more than one station")])
def test_a_second_signal_shows_by_its_misfit(misfit: float, told: str) -> None:
    assert CHI_SQUARE_LIMIT == 6.0
    assert CHECK.disturbance(amplitude=1e-4, snr=100.0, reduced_chi_square=misfit) == told


@pytest.mark.parametrize(("share", "told"), [(0.99, ""), (1.01, "hears more than one station")])
def test_and_by_its_share_of_the_signal(share: float, told: str) -> None:
    # A strong signal fits worse than its noise by what the receiver leaves out.
    misfit = 50.0
    snr = misfit / (share * RESIDUAL_FRACTION * SAMPLES)
    amplitude = math.sqrt(NOISE_MW * snr)
    assert CHECK.disturbance(amplitude=amplitude, snr=snr, reduced_chi_square=misfit) == told


@pytest.mark.parametrize(
    ("amplitude", "snr"), [(math.nan, 10.0), (math.inf, 10.0), (1e-4, 0.0), (1e-4, math.nan)]
)
def test_what_is_no_number_is_not_returned(amplitude: float, snr: float) -> None:
    found = CHECK.disturbance(amplitude=amplitude, snr=snr, reduced_chi_square=1.0)
    assert found == "cannot read the tone"
