"""Figures 5 to 13 of Kim et al. (DSP of railway signals), and the receiver's own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from scipy.signal import hilbert, sosfilt, square

from rail_corridor.plotting import FigureSpec
from rail_signals.arrays import FloatArray
from rail_signals.track_code.demodulator import DemodulatorChain
from rail_signals.track_code.filters import dc_rejecter, post_demodulation_filter, response
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import encode

from . import track_code_errors as track_code_error_figure

BOARD_RATE_HZ = 50_000.0  # 20 us, the sampling time of the document's board
NOISE_HZ = 8000.0


def three_tones() -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and |X| of three tones of amplitude 1 in 100 samples at 100 Hz (Fig. 5)."""
    time_s = np.arange(100) / 100.0
    wave = sum(np.sin(2 * np.pi * tone_hz * time_s) for tone_hz in (20.0, 25.0, 30.0))
    return np.asarray(np.fft.rfftfreq(100, 0.01), float), np.abs(np.fft.rfft(wave))


def noisy_wave(frequency_hz: float, samples: int, *, squared: bool = False) -> FloatArray:
    """A wave on the document's board with its noise of 8 kHz (Figs 6 to 11)."""
    time_s = np.arange(samples) / BOARD_RATE_HZ
    turn = 2 * np.pi * frequency_hz * time_s
    wave = square(turn) if squared else np.sin(turn)
    return np.asarray(wave + 0.5 * np.sin(2 * np.pi * NOISE_HZ * time_s))


def board_spectrum(wave: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Frequencies [Hz] and |X| of samples of the document's board."""
    frequencies_hz = np.fft.rfftfreq(len(wave), 1 / BOARD_RATE_HZ)
    return np.asarray(frequencies_hz, float), np.abs(np.fft.rfft(wave))


def filtered(wave: FloatArray) -> FloatArray:
    """A wave of the board after an elliptic low-pass that takes the 8 kHz away (Figs 6, 7)."""
    # The project's post-demodulation filter, designed for a rate where it ends below 8 kHz.
    return np.asarray(sosfilt(post_demodulation_filter(BOARD_RATE_HZ / 32.0), wave))


def demodulated(seconds: float = 1.5) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time [s], synthesised wave [Hz] and what the receiver demodulates [Hz] (Fig. 13)."""
    profile = load_profile("three_tones")
    rate_hz, carrier_hz = 16_000.0, 1700.0
    bits = encode(profile, {name: 1 for name, _ in profile.fields})
    count = round(seconds * rate_hz)
    wave = FmTransmitter(profile, carrier_hz, rate_hz).block(bits, count)
    chain = DemodulatorChain(profile, carrier_hz, rate_hz)
    quadrature = hilbert(sosfilt(chain.band_pass, wave))
    step = quadrature[1:] * np.conj(quadrature[:-1]) * np.exp(-2j * np.pi * carrier_hz / rate_hz)
    frequency_hz = np.angle(step) * rate_hz / (2 * np.pi)
    received = sosfilt(post_demodulation_filter(rate_hz), frequency_hz)
    time_s = np.arange(1, count) / rate_hz
    sent = np.zeros_like(time_s)
    for tone_hz, deviation_hz in zip(profile.tones_hz, profile.deviations_hz, strict=True):
        sent += deviation_hz * np.sin(2 * np.pi * tone_hz * time_s)
    return time_s, sent, np.asarray(received)


def _fig5(figure: Figure) -> None:
    axes = figure.subplots()
    axes.stem(*three_tones(), basefmt=" ")
    axes.set(
        title="Three tones in a rectangular window: 50 in their own bins, nothing elsewhere",
        xlabel="frequency [Hz]",
        ylabel="|X|",
    )


def _spectra(figure: Figure, title: str, waves: dict[str, FloatArray], marked_hz: float) -> None:
    axes = figure.subplots()
    for label, wave in waves.items():
        frequency_hz, height = board_spectrum(wave)
        peak_hz = frequency_hz[1 + int(np.argmax(height[1:]))]
        axes.plot(frequency_hz, height, label=f"{label}: peak at {peak_hz:.2f} Hz")
    axes.axvline(marked_hz, color="#000000", linestyle=":", linewidth=1.0, label="sent")
    axes.set(title=title, xlabel="frequency [Hz]", ylabel="|X|", xlim=(0.0, 10_000.0))
    axes.set_xscale("symlog", linthresh=1000.0)
    axes.legend()


def _filter(figure: Figure, frequency_hz: float, *, squared: bool) -> None:
    wave = noisy_wave(frequency_hz, 2048, squared=squared)
    time_ms = 1e3 * np.arange(wave.size) / BOARD_RATE_HZ
    above, below = figure.subplots(2, 1, sharex=True, sharey=True)
    above.plot(time_ms, wave, color="#0072B2")
    below.plot(time_ms, filtered(wave), color="#D55E00")
    kind = "square wave" if squared else "sine"
    above.set(title=f"A {kind} of {frequency_hz:.0f} Hz with noise of 8 kHz", ylabel="before")
    below.set(ylabel="after the low-pass", xlabel="time [ms]", xlim=(20.0, 35.0), ylim=(-1.9, 1.9))


def fm_wave(seconds: float = 0.1) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time [s], deviation sent [Hz] and the carrier of it, three times as deep (Fig. 12)."""
    profile = load_profile("three_tones")
    deep = replace(profile, deviations_hz=tuple(3.0 * d for d in profile.deviations_hz))
    rate_hz, carrier_hz = 48_000.0, 500.0
    bits = encode(deep, {name: 1 for name, _ in deep.fields})
    wave = FmTransmitter(deep, carrier_hz, rate_hz).block(bits, round(seconds * rate_hz))
    time_s = np.arange(wave.size) / rate_hz
    sent = np.zeros_like(time_s)
    for tone_hz, deviation_hz in zip(deep.tones_hz, deep.deviations_hz, strict=True):
        sent += deviation_hz * np.sin(2 * np.pi * tone_hz * time_s)
    return time_s, sent, np.asarray(wave)


def _fig12(figure: Figure) -> None:
    time_s, sent, wave = fm_wave()
    above, below = figure.subplots(2, 1, sharex=True)
    above.plot(1e3 * time_s, sent, color="#0072B2")
    below.plot(1e3 * time_s, wave, color="#D55E00", lw=1.0)
    above.set(title="Three tones on a carrier of 500 Hz", ylabel="deviation sent [Hz]")
    below.set(ylabel="carrier", xlabel="time [ms]", xlim=(0.0, 1e3 * time_s[-1]))


def _fig8(figure: Figure) -> None:
    waves = {f"{count} samples": noisy_wave(400.0, count) for count in (516, 512)}
    _spectra(figure, "400 Hz and noise of 8 kHz, sampled every 20 µs", waves, 400.0)


def _fig9(figure: Figure) -> None:
    time_s = np.arange(8192) / BOARD_RATE_HZ
    waves = {"8192 samples": np.asarray(np.sin(2 * np.pi * 300.0 * time_s))}
    _spectra(figure, "300 Hz without noise: bin 49", waves, 300.0)


def _fig10(figure: Figure) -> None:
    wave = noisy_wave(200.0, 8192, squared=True)
    waves = {"before the filter": wave, "after": filtered(wave)}
    _spectra(figure, "A square wave of 200 Hz and noise: the fundamental stands out", waves, 200.0)


def _fig11(figure: Figure) -> None:
    wave = noisy_wave(400.0, 8192)
    waves = {"before the filter": wave, "after": filtered(wave)}
    _spectra(figure, "A sine of 400 Hz and noise: the fundamental stands out", waves, 400.0)


def _fig13(figure: Figure) -> None:
    time_s, sent, received = demodulated()
    lag = delay_samples(sent, received)
    lag_s = lag * (time_s[1] - time_s[0])
    axes = figure.subplots()
    axes.plot(time_s, sent, label="synthesised in the transmitter")
    axes.plot(time_s - lag_s, received, "--", label=f"demodulated, {1e3 * lag_s:.1f} ms later")
    axes.set(
        title="What is put onto the carrier comes off it",
        xlabel="time [s]",
        ylabel="frequency deviation [Hz]",
        xlim=(0.8, 1.2),
        ylim=(-75.0, 95.0),
    )
    axes.legend()


def _rejecter(figure: Figure) -> None:
    frequency_hz = np.linspace(0.05, 5.0, 500)
    gain_db = 20.0 * np.log10(np.abs(response(dc_rejecter(), frequency_hz, 128.0)))
    axes = figure.subplots()
    axes.plot(frequency_hz, gain_db)
    for tone_hz in load_profile("tones27").tones_hz[:7]:
        axes.axvline(tone_hz, color="#000000", linestyle=":", linewidth=0.8)
    axes.set(
        title="DC rejecter at 128 Hz: the lowest tone (dotted) loses 1.06 dB, the next 0.17 dB",
        xlabel="frequency [Hz]",
        ylabel="gain [dB]",
        ylim=(-30.0, 1.0),
    )


def delay_samples(sent: FloatArray, received: FloatArray, most: int = 800) -> int:
    """Lag at which two waves agree best."""
    tail = len(sent) // 2
    errors = [
        float(np.sum((received[tail:] - sent[tail - lag : len(sent) - lag]) ** 2))
        for lag in range(most)
    ]
    return int(np.argmin(errors))


FIGURES: dict[str, FigureSpec] = {
    "track_code_fig05_three_tones": FigureSpec(
        _fig5,
        "Fig 5: the spectrum of three tones in a rectangular window of 100 samples. Each lies in "
        "its own bin with |X| = 50; there is nothing elsewhere.",
    ),
    "track_code_fig06_filtered_square": FigureSpec(
        lambda figure: _filter(figure, 200.0, squared=True),
        "Fig 6: a square wave of 200 Hz with noise of 8 kHz, before and after the low-pass.",
    ),
    "track_code_fig07_filtered_sine": FigureSpec(
        lambda figure: _filter(figure, 400.0, squared=False),
        "Fig 7: a sine of 400 Hz with noise of 8 kHz, before and after the low-pass.",
    ),
    "track_code_fig08_sine_spectrum": FigureSpec(
        _fig8,
        "Fig 8: the nearest bin depends on the number of samples: 387.6 Hz with 516, 390.6 Hz "
        "with 512, for 400 Hz.",
    ),
    "track_code_fig09_board_fft": FigureSpec(
        _fig9, "Fig 9: 300 Hz in 8192 samples of 20 µs: the peak is bin 49, at 299.07 Hz."
    ),
    "track_code_fig10_square_spectrum": FigureSpec(
        _fig10,
        "Fig 10: the spectrum of Fig 6. The fundamental stands out; the low-pass takes the noise "
        "of 8 kHz away.",
    ),
    "track_code_fig11_filtered_sine": FigureSpec(
        _fig11, "Fig 11: the spectrum of Fig 7, before and after the low-pass."
    ),
    "track_code_fig12_fm_wave": FigureSpec(
        _fig12,
        "Fig 12: the carrier in the rails and the wave that modulates it: its periods shorten "
        "where the wave is high. The deviation is three times that of the profile, to be seen.",
    ),
    "track_code_fig13_demodulated": FigureSpec(
        _fig13,
        "Fig 13: the wave synthesised in the transmitter and what the receiver demodulates, set "
        "off by its delay.",
    ),
    "track_code_dc_rejecter": FigureSpec(
        _rejecter,
        "Equation 10, with its gain mended: the DC rejecter leaves all but the lowest tone alone.",
    ),
    "track_code_message_errors": FigureSpec(
        track_code_error_figure.draw,
        "Words of 27 tones that are lost: the bound for one slot of 1.6 s, the maximum-likelihood "
        "fit started near the truth (250 words a point), and the document's chain with its "
        "discriminator and all its rules (100 slots a point). docs/track_codes.md has long counts.",
    ),
}
