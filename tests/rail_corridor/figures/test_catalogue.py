"""Figures: the numbers of the documents come out, and every picture can be drawn."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

from rail_corridor.cli.main import main
from rail_corridor.figures import run as run_figures
from rail_corridor.figures import train_radio as train_radio_figures
from rail_corridor.figures.catalogue import FIGURES, draw, write_index
from rail_corridor.figures.doppler import AHEAD_HZ, STRAIGHT, shifts_hz
from rail_corridor.figures.ranging import comparator_ranges, range_errors
from rail_corridor.figures.track_code import (
    board_spectrum,
    delay_samples,
    demodulated,
    filtered,
    fm_wave,
    noisy_wave,
    three_tones,
)
from rail_corridor.figures.track_code_errors import bound, chain_losses
from rail_corridor.figures.train_bus import smallest_ohm
from rail_corridor.plotting import FigureSpec
from rail_corridor.recording.parts import Recording
from rail_corridor.report.from_recording import run_of
from rail_signals.ranging.bounds import two_way_range_variance_bound
from rail_signals.ranging.signal import RangingSignal
from rail_signals.track_code.bound import message_error_bound
from rail_signals.track_code.profile import load_profile
from rail_signals.train_radio.ber.closed_form import SCHEMES, error_rate

#: Figures that count or search; what they count is tested with less of it.
SLOW = {
    "ranging_error_over_snr",
    "track_code_message_errors",
    "train_bus_limits",
    "train_radio_brakings",
    "train_radio_fig03_error_rates",
}


def drawn(name: str) -> Figure:
    figure = Figure()
    FIGURES[name].draw(figure)
    return figure


def texts(figure: Figure) -> str:
    found = [text.get_text() for axes in figure.axes for text in axes.texts]
    found += [axes.get_title() for axes in figure.axes]
    for axes in figure.axes:
        legend = axes.get_legend()
        found += [] if legend is None else [text.get_text() for text in legend.get_texts()]
    return "\n".join(found)


def test_the_registry_covers_the_documents_and_says_what_to_see() -> None:
    numbered = [name for name in FIGURES if "_fig" in name]
    expected = {
        "ranging": {3, 4, 5, 6, 7, 8},
        "train_bus": {2, 3, 5, 6},
        "track_code": {5, 6, 7, 8, 9, 10, 11, 12, 13},
        "train_radio": {3},
    }
    for source, numbers in expected.items():
        mine = [name for name in numbered if name.startswith(source)]
        assert {int(name.split("_fig")[1][:2]) for name in mine} == numbers
    assert any(name.startswith("doppler") for name in FIGURES)
    for name, one in {**FIGURES, **run_figures.FIGURES}.items():
        assert name == name.lower() and " " not in name
        assert 40 < len(one.caption) < 320 and one.caption.rstrip().endswith((".", ")")), name
    assert set(FIGURES) >= SLOW


def test_the_gate_makes_a_microsecond_of_both_phases() -> None:
    """FACTS: 1.000 us for 45 and for 315 degrees."""
    for name in ("ranging_fig05_and_45", "ranging_fig06_and_315"):
        figure = drawn(name)
        assert "1.000 µs" in texts(figure)
        wave = figure.axes[2].lines[0]
        time_us, level = np.asarray(wave.get_xdata()), np.asarray(wave.get_ydata())
        share = float(np.mean(level > 0))
        assert share == pytest.approx(0.375, abs=0.01)
        assert time_us[-1] == pytest.approx(2 / 0.375, abs=0.02)


def test_comparators_fold_where_they_must() -> None:
    gate_m, full_m = comparator_ranges(np.array([50.0, 350.0 - 0.28, 150.0]))
    np.testing.assert_allclose(gate_m, [50.0, 50.0, 150.0], atol=0.05)
    np.testing.assert_allclose(full_m, [50.0, 349.72, 150.0], atol=0.05)


def test_zones_take_channels_in_turn() -> None:
    """FACTS: CH1/CH2, CH3/CH4, CH1/CH2; on the branch CH5/CH6 and CH7/CH8 from WRS5 on."""
    plain = texts(drawn("ranging_fig07_zones")).splitlines()
    assert [t for t in plain if t.startswith("CH")][:3] == ["CH1/2", "CH3/4", "CH1/2"]
    branch = texts(drawn("ranging_fig08_branch"))
    for label in ("zone5\nCH1/2", "zone6\nCH3/4", "zone7\nCH5/6", "zone9\nCH7/8", "zone10\nCH5/6"):
        assert label in branch


def test_range_errors_lie_at_the_bound() -> None:
    signal, rng = RangingSignal(), np.random.default_rng(1)
    lines, discriminator = range_errors(10.0, 300, rng, signal)
    bound_m = float(np.sqrt(two_way_range_variance_bound(10.0, 10.0, signal.samples, 1.0, 375e3)))
    for errors in (lines, discriminator):
        assert np.sqrt(np.mean(errors**2)) == pytest.approx(bound_m, rel=0.15)
    lines, discriminator = range_errors(0.5, 300, rng, signal)
    assert np.std(discriminator) > 2.0 * np.std(lines)


def test_doppler_functions_vanish_at_the_train() -> None:
    assert abs(AHEAD_HZ - 722.7) < 0.05
    figure = drawn("doppler_straight")
    x, height = (np.asarray(v) for v in figure.axes[0].lines[0].get_data())
    assert x[np.argmin(height)] == pytest.approx(200.0)
    assert STRAIGHT.position(shifts_hz(STRAIGHT, 200.0))[0] == pytest.approx(200.0, abs=1e-3)
    off, depth = (np.asarray(v) for v in figure.axes[0].lines[1].get_data())
    assert abs(off[np.argmin(depth)] - 200.0) > 300.0
    mixed = texts(drawn("doppler_mixed"))
    assert "-350 m: straight chosen" in mixed and "300 m: arc chosen" in mixed


def test_alamouti_gains_what_it_must() -> None:
    """FACTS: 4.05, 6.12 and 8.36 dB."""
    found = texts(drawn("train_radio_gain"))
    assert all(f"{gain} dB" in found for gain in ("4.05", "6.12", "8.36"))


def test_counted_bits_lie_on_the_closed_form() -> None:
    for name, level_db in (("siso", 10.0), ("alamouti_2x2", 5.0)):
        found = train_radio_figures.counted(SCHEMES[name], level_db)
        assert found.rate == pytest.approx(
            float(error_rate(SCHEMES[name], 10.0 ** (level_db / 10.0), 1)), rel=0.2
        )


def test_echoes_and_stubs_of_the_train_bus() -> None:
    """FACTS: 475.1 and 272.9 ns, 733.2 and 421.2 ns; 166.7 mm at 13 ns, 1 m at 78 ns."""
    echoes = texts(drawn("train_bus_fig06_echoes"))
    assert all(f"{ns} ns" in echoes for ns in (475.1, 272.9, 733.2, 421.2))
    stubs = texts(drawn("train_bus_fig02_stub"))
    assert "13 ns: 166.7 mm" in stubs and "78 ns: 1000" in stubs
    ends = [line.get_ydata()[-1] for line in drawn("train_bus_fig03_mismatches").axes[0].lines]
    np.testing.assert_allclose(np.asarray(ends), [1.0, 1 / 3, 0.0, -1 / 3, -1.0], atol=1e-4)


def test_less_noise_shows_smaller_faults() -> None:
    assert 0.1 < smallest_ohm("bad_splice", 60.0, 0) < smallest_ohm("bad_splice", 40.0, 0) < 10.0


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


def test_the_carrier_follows_the_wave_that_is_sent() -> None:
    time_s, sent_hz, wave = fm_wave()
    rises = np.flatnonzero((wave[:-1] <= 0) & (wave[1:] > 0))
    period_s = np.diff(time_s[rises])
    middle = (rises[1:] + rises[:-1]) // 2
    np.testing.assert_allclose(1.0 / period_s, 500.0 + sent_hz[middle], rtol=0.06)


def test_what_is_demodulated_is_what_was_synthesised() -> None:
    _, sent, received = demodulated()
    lag = delay_samples(sent, received)
    late = len(sent) // 2
    error = received[late:] - sent[late - lag : len(sent) - lag]
    # The band-pass bends the phases of the three tones a little against each other.
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(np.mean(sent**2))


def test_message_errors_are_those_of_the_bound() -> None:
    profile = load_profile("three_tones")
    samples = profile.slot_samples * 10
    wanted = message_error_bound(
        profile.tones_hz, profile.deviations_hz, 10**1.6 / 640.0, samples, 640.0
    )
    assert bound(profile, [16.0])[0] == pytest.approx(wanted, rel=1e-9)
    rng = np.random.default_rng(2)
    lost, slots = chain_losses(load_profile("tones27"), 45.0, 20.0, rng)
    assert lost == 0 and slots >= 5
    lost, slots = chain_losses(load_profile("tones27"), 24.0, 20.0, rng)
    assert lost == slots


@pytest.mark.parametrize("name", sorted(set(FIGURES) - SLOW))
def test_every_figure_is_drawn_and_says_what_its_axes_are(name: str, tmp_path: Path) -> None:
    values: list[Figure] = []

    def drawing(figure: Figure) -> None:
        FIGURES[name].draw(figure)
        values.append(figure)

    (path,) = draw(tmp_path / "pictures", {name: FigureSpec(drawing, FIGURES[name].caption)})
    assert path.name == f"{name}.png"
    picture = matplotlib.image.imread(path)
    assert min(picture.shape[:2]) > 400
    assert picture[..., :3].std() > 0.01  # not blank
    for axes in values[0].axes:
        assert axes.get_ylabel() or axes.get_yticklabels()
    assert values[0].axes[-1].get_xlabel()


def test_the_page_shows_every_figure(tmp_path: Path) -> None:
    page = write_index(tmp_path, FIGURES).read_text()
    assert all(f'src="{name}.png"' in page for name in FIGURES)


def test_figures_of_a_run(made_up: Callable[..., Any], tmp_path: Path) -> None:
    made = made_up()
    made.write()
    with Recording(made.path) as file:
        run = run_of(file)
    pictures = run_figures.figure_specs_of(run)
    assert set(pictures) == {"run_time_distance", "run_position_error", "run_handovers"}
    for path in draw(tmp_path, pictures):
        assert matplotlib.image.imread(path)[..., :3].std() > 0.01
    figure = Figure()
    pictures["run_time_distance"].draw(figure)
    time_s, front_m = (np.asarray(v) for v in figure.axes[0].lines[0].get_data())
    assert front_m[0] == 20.0 and front_m[-1] == 20.0 + 2.0 * 59
    assert time_s[-1] == pytest.approx(6.0)
    figure = Figure()
    pictures["run_position_error"].draw(figure)
    error_m = np.asarray(figure.axes[0].lines[0].get_ydata(), dtype=float)
    rmse_m = made.report["trains"]["train_a"]["phase_ranging"]["rmse_m"]
    assert np.sqrt(np.nanmean(error_m**2)) == pytest.approx(rmse_m, rel=1e-3)


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("--list",), 0, "run_time_distance"),
        (("--only", "run_*"), 0, "not drawn: run_time_distance"),
        (("--only", "nonsense"), 2, "rail: --only: 'nonsense': is not one of"),
        (("--from", "missing.mcap"), 2, "missing.mcap"),
    ],
)
def test_the_command(
    arguments: tuple[str, ...],
    code: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["rail", "figures", "pictures", *arguments])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == code
    shown = capsys.readouterr()
    assert said in shown.out + shown.err
    assert (len(shown.err.splitlines()) == 1) == (code == 2)


def test_patterns_choose_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["--only", "track_code_fig0[59]*", "--only", "train_bus_fig03*"]
    monkeypatch.setattr(sys, "argv", ["rail", "figures", str(tmp_path / "new"), *asked])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0
    names = [
        "track_code_fig05_three_tones",
        "track_code_fig09_board_fft",
        "train_bus_fig03_mismatches",
    ]
    assert sorted(path.stem for path in (tmp_path / "new").glob("*.png")) == names
    assert "index.html" in capsys.readouterr().out
