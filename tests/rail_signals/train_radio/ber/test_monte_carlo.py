"""The fast engine decides as the equations do, bit for bit, and counts what theory predicts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from rail_signals.train_radio.ber.closed_form import ALAMOUTI_2X2, SCHEMES, SISO, error_rate
from rail_signals.train_radio.ber.link import LANES, DiversityLink
from rail_signals.train_radio.ber.monte_carlo import Result, clopper_pearson, until
from rail_signals.train_radio.ber.plain_link import PlainLink
from rail_signals.train_radio.ber.stale_channel import stale_error_rate
from rail_signals.train_radio.space_time_block import Scheme

ALL = pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)
BITS = pytest.mark.parametrize("bits", [1, 2], ids=["bpsk", "qpsk"])


@ALL
@BITS
@pytest.mark.parametrize("correlation", [1.0, 0.6], ids=["constant", "moving"])
def test_decisions_are_those_of_the_equations(
    scheme: Scheme, bits: int, correlation: float
) -> None:
    link = DiversityLink(
        scheme, 3.0, bits_per_symbol=bits, correlation=correlation, code_blocks=LANES
    )
    generator = np.random.SFC64(12)
    disagreed = 0
    for _ in range(64):
        errors, squares = link.step(generator)
        last = link.last()
        found = naive(scheme, last["sent"], last["channel"], last["noise"])
        parts = np.stack([found.real, found.imag], axis=1)[:, :bits]
        # Single precision may decide otherwise only where there is nothing to decide.
        differ = (parts < 0) != last["decided"]
        assert (np.abs(parts[differ]) < 1e-4).all()
        disagreed += int(differ.sum())
        wrong = last["decided"] != last["sent"]
        assert errors == wrong.sum()
        assert squares == (wrong.sum(axis=(0, 1)) ** 2).sum()
    assert disagreed == 0


def naive(scheme: Scheme, sent: np.ndarray, channel: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Eqs 1-8 in complex128, one code block after the other's shapes; returns [symbol, block]."""
    x = 1.0 - 2.0 * sent[:, 0] + (1j * (1.0 - 2.0 * sent[:, 1]) if sent.shape[1] == 2 else 0)
    if scheme.transmit == 2:
        x = x.astype(np.complex128)
        code = np.array([[x[0], -x[1].conj()], [x[1], x[0].conj()]])
    else:
        code = x[None]
    # code [transmitter, time, block]; channel [time, receiver, transmitter, block]
    heard = np.einsum("trmb,mtb->rtb", channel, code) + noise
    h = channel[0]
    if scheme.transmit == 1:
        return np.einsum("rb,rtb->tb", h[:, 0].conj(), heard)
    y1, y2 = heard[:, 0], heard[:, 1].conj()
    first = h[:, 0].conj() * y1 + h[:, 1] * y2
    second = h[:, 1].conj() * y1 - h[:, 0] * y2
    return np.stack([first.sum(axis=0), second.sum(axis=0)])


@ALL
@pytest.mark.parametrize("level_db", [0, 5, 10])
def test_closed_form_lies_inside_the_interval(scheme: Scheme, level_db: int) -> None:
    eb_n0 = 10 ** (level_db / 10)
    link = DiversityLink(scheme, eb_n0, bits_per_symbol=2)
    found = until(
        link, np.random.SFC64(level_db + 1), half_width=0.15, confidence=0.999, min_errors=400
    )
    assert found.errors >= 400
    assert found.holds(float(error_rate(scheme, eb_n0)))


@ALL
@BITS
def test_floor_of_a_moving_train_lies_inside_the_interval(scheme: Scheme, bits: int) -> None:
    link = DiversityLink(scheme, math.inf, bits_per_symbol=bits, correlation=0.8)
    found = until(link, np.random.SFC64(2), half_width=0.1, confidence=0.999)
    assert found.holds(float(stale_error_rate(scheme, math.inf, 0.8, bits)))


@pytest.mark.parametrize("bits", [1, 2, 4])
@ALL
def test_the_plain_link_agrees_too(scheme: Scheme, bits: int) -> None:
    link = PlainLink(scheme, 4.0, bits_per_symbol=bits)
    found = until(link, np.random.PCG64(4), half_width=0.1, confidence=0.999)
    assert found.holds(float(error_rate(scheme, 4.0, bits)))


@ALL
def test_no_noise_no_errors(scheme: Scheme) -> None:
    for bits in (1, 2):
        assert (
            DiversityLink(scheme, math.inf, bits_per_symbol=bits).step(np.random.SFC64(1))[0] == 0
        )
    assert PlainLink(scheme, math.inf, bits_per_symbol=4).step(np.random.SFC64(1))[0] == 0


def test_the_same_seed_gives_the_same_result() -> None:
    def run(seed: int) -> Result:
        return until(DiversityLink(ALAMOUTI_2X2, 3.0), np.random.SFC64(seed), half_width=0.2)

    assert run(9) == run(9)
    assert run(9) != run(10)


def deviates(draws: int) -> np.ndarray:
    """Normal deviates of the engine, of unit variance [draws]."""
    link = DiversityLink(ALAMOUTI_2X2, 2.0, code_blocks=LANES)
    generator, parts = np.random.SFC64(21), []
    while sum(p.size for p in parts) < draws:
        link.step(generator)
        last = link.last()
        for values in (last["channel"][0], last["noise"]):
            parts += [values.real.ravel(), values.imag.ravel()]
    return np.asarray(np.concatenate(parts) * math.sqrt(2))


def test_deviates_are_normal() -> None:
    x = deviates(2_000_000)
    edges = np.concatenate([[-np.inf], np.linspace(-4.5, 4.5, 91), [np.inf]])
    counts, _ = np.histogram(x, edges)
    assert stats.chisquare(counts, x.size * np.diff(stats.norm.cdf(edges))).pvalue > 1e-3
    assert abs(np.mean(x)) < 4 / math.sqrt(x.size)
    assert abs(np.mean(x**2) - 1) < 4 * math.sqrt(2 / x.size)
    assert abs(np.mean(x**4) - 3) < 4 * math.sqrt(96 / x.size)


def test_256_directions_give_the_normal_tail() -> None:
    # P(r cos > x) of a radius without limit and directions of one part in 256.
    cosine = np.cos((np.arange(256) + 0.5) * (math.pi / 128))
    forward = cosine[cosine > 1e-9]
    for x in (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0):
        tail = np.exp(-((x / forward) ** 2) / 2).sum() / 256
        assert tail == pytest.approx(float(stats.norm.sf(x)), rel=1e-6)


def test_errors_of_a_block_come_together() -> None:
    # SISO QPSK: four bits share a fade. The interval must be that of fewer bits.
    eb_n0 = 10.0
    found = until(DiversityLink(SISO, eb_n0), np.random.SFC64(3), half_width=0.05)
    # Intraclass correlation by the closed form of the mean of p^2.
    gain = -np.log((np.arange(1_000_000) + 0.5) / 1e6)
    p = stats.norm.sf(np.sqrt(2 * eb_n0 * gain))
    expected = 1 + 3 * (np.mean(p**2) - p.mean() ** 2) / (p.mean() * (1 - p.mean()))
    assert found.clumping == pytest.approx(expected, rel=0.05)
    assert expected > 1.3
    narrow = clopper_pearson(found.errors, found.bits, 0.95)
    assert found.interval[0] < narrow[0] < narrow[1] < found.interval[1]


def test_intervals_hold_as_often_as_they_say() -> None:
    truth = float(error_rate(SISO, 3.0))
    link, generator = DiversityLink(SISO, 3.0, code_blocks=LANES), np.random.SFC64(8)
    runs = 400
    held = sum(
        until(link, generator, max_bits=8192, min_errors=10**6).holds(truth) for _ in range(runs)
    )
    assert stats.binomtest(held, runs, 0.95).pvalue > 1e-3


def test_stops_for_each_reason() -> None:
    generator = np.random.SFC64(6)
    link = DiversityLink(ALAMOUTI_2X2, 1.0, code_blocks=LANES)
    tight = until(link, generator, half_width=0.1, confidence=0.95, min_errors=1)
    width = (tight.interval[1] - tight.interval[0]) / 2
    assert 0.08 * tight.rate < width <= 0.1 * tight.rate
    assert until(link, generator, half_width=1.0, min_errors=5000).errors >= 5000
    short = until(link, generator, half_width=1e-6, max_bits=10_000)
    assert 10_000 <= short.bits < 10_000 + link.bits_per_step
    silent = until(DiversityLink(ALAMOUTI_2X2, 1e9), generator, max_bits=1e5, confidence=0.95)
    assert silent.interval == (0.0, pytest.approx(1 - 0.025 ** (1 / silent.bits)))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"eb_n0": 0.0}, r"got 0\.0"),
        ({"bits_per_symbol": 4}, "got 4"),
        ({"correlation": 1.5}, r"got 1\.5"),
        ({"code_blocks": 12}, "got 12"),
    ],
)
def test_a_bad_value_is_quoted(options: dict[str, float], message: str) -> None:
    values: dict[str, object] = {"eb_n0": 1.0, **options}
    with pytest.raises(ValueError, match=message):
        DiversityLink(SISO, **values)  # type: ignore[arg-type]


def test_bad_limits_are_quoted() -> None:
    link, generator = DiversityLink(SISO, 1.0), np.random.SFC64(1)
    with pytest.raises(ValueError, match="half_width must be positive, got -1"):
        until(link, generator, half_width=-1)
    with pytest.raises(ValueError, match=r"got 1\.0"):
        until(link, generator, confidence=1.0)
    with pytest.raises(ValueError, match="got 5 of 3"):
        clopper_pearson(5, 3, 0.9)
    with pytest.raises(ValueError, match="got 3"):
        PlainLink(SISO, 1.0, bits_per_symbol=3)
    with pytest.raises(ValueError, match="got -1"):
        PlainLink(SISO, -1)
