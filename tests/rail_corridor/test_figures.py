"""Figures: the numbers of the documents come out, and every picture can be drawn."""

from __future__ import annotations

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest

from rail_corridor.figures import FIGURES, draw
from rail_corridor.track_code_figures import (
    board_spectrum,
    delay_samples,
    demodulated,
    filtered,
    noisy_wave,
    three_tones,
)


def test_three_tones_lie_in_their_bins() -> None:
    frequency_hz, height = three_tones()
    there = np.isin(frequency_hz, (20.0, 25.0, 30.0))
    np.testing.assert_allclose(height[there], 50.0, rtol=1e-12)
    assert height[~there].max() < 1e-11


@pytest.mark.parametrize(
    ("frequency_hz", "samples", "squared", "peak_hz"),
    [(400.0, 516, False, 387.60), (400.0, 512, False, 390.625), (200.0, 8192, True, 201.42)],
)
def test_peaks_of_noisy_waves(
    frequency_hz: float, samples: int, squared: bool, peak_hz: float
) -> None:
    wave = noisy_wave(frequency_hz, samples, squared=squared)
    found_hz, height = board_spectrum(wave)
    assert found_hz[np.argmax(height)] == pytest.approx(peak_hz, abs=0.01)


def test_the_filter_takes_the_noise_and_leaves_the_wave() -> None:
    frequency_hz, before = board_spectrum(noisy_wave(400.0, 8192))
    _, after = board_spectrum(filtered(noisy_wave(400.0, 8192)))
    noise = np.abs(frequency_hz - 8000.0) < 50.0
    wave = np.abs(frequency_hz - 400.0) < 50.0
    assert after[noise].max() < 1e-2 * before[noise].max()
    assert after[wave].max() == pytest.approx(before[wave].max(), rel=0.05)


def test_what_is_demodulated_is_what_was_synthesised() -> None:
    _, sent, received = demodulated()
    lag = delay_samples(sent, received)
    late = len(sent) // 2
    error = received[late:] - sent[late - lag : len(sent) - lag]
    # The band-pass bends the phases of the three tones a little against each other.
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(np.mean(sent**2))


@pytest.mark.parametrize("name", sorted(FIGURES))
def test_every_figure_is_drawn(name: str, tmp_path: Path) -> None:
    (path,) = draw(tmp_path / "pictures", (name,))
    assert path.name == f"{name}.png"
    picture = matplotlib.image.imread(path)
    assert min(picture.shape[:2]) > 400
    assert picture[..., :3].std() > 0.01  # not blank
