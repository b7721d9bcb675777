"""The bank of filters: closed forms, an independent filter, and its own covariance as oracles."""

from __future__ import annotations

from dataclasses import replace
from math import inf, sqrt

import numpy as np
import pytest
from scipy import stats
from scipy.linalg import solve_discrete_are

from rail_signals.localizer import filter_bank
from rail_signals.localizer.filter_bank import (
    FILTERS,
    RANGE_BIAS,
    SCALE,
    SLIP,
    STATES,
    USES,
    A,
    FilterBank,
    MeasurementRow,
    S,
    V,
    singer,
)
from rail_signals.localizer.filter_kernel import predict_filters, take_scalar
from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.readings import (
    BlockEntry,
    DopplerFix,
    MeasurementModel,
    RangeFix,
    TickMeasurements,
    WheelSpeed,
)
from rail_signals.localizer.settings import (
    BlockModel,
    DopplerModel,
    LocalizerSettings,
    MotionModel,
    OdometerModel,
    RangeModel,
    Sensor,
)

ALL = np.ones(len(FILTERS), dtype=np.bool_)


def test_filters_leave_out_nothing_each_sensor_and_each_pair() -> None:
    assert [len(out) for out in FILTERS] == [0, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2]
    for sensor in Sensor:
        assert [sensor not in out for out in FILTERS] == USES[sensor].tolist()
        assert FILTERS[1 + sensor] == {sensor}


@pytest.mark.parametrize("step_s", [1e-3, 0.1, 2.0, 30.0, 3000.0])
def test_two_steps_of_the_motion_are_one_of_twice_the_length(step_s: float) -> None:
    motion = MotionModel(0.7, 4.0)
    transition, added = singer(step_s, motion)
    twice, added_twice = singer(2.0 * step_s, motion)
    np.testing.assert_allclose(transition @ transition, twice, rtol=1e-9, atol=1e-12)
    expected = transition @ added @ transition.T + added
    np.testing.assert_allclose(expected, added_twice, rtol=1e-9)
    # For a short step the jerk is white noise of this density, integrated three times.
    if step_s == 1e-3:
        density = 2.0 * 0.7**2 / 4.0
        assert added[S, S] == pytest.approx(density * step_s**5 / 20.0, rel=1e-3)


def test_a_scalar_filter_reaches_the_closed_form_of_its_steady_state() -> None:
    wheels = OdometerModel(correlation_s=2.0)
    bank = FilterBank(LocalizerSettings(odometer=wheels))
    bank.place(np.array(True), 0.0, 1.0, 0.0, 1.0)
    sigma, noise = 0.6, 0.04
    for _ in range(400):
        bank.predict(0.1, sigma, False)
        predicted = bank.variances[SLIP].copy()
        bank.take([(SLIP, None)], 0.0, noise, ALL)
    kept2 = np.exp(-2.0 * 0.1 / 2.0)
    added = sigma**2 * (1.0 - kept2)
    # P = kept^2 P r / (P + r) + q.
    middle = added - noise * (1.0 - kept2)
    steady = 0.5 * (middle + sqrt(middle**2 + 4.0 * added * noise))
    np.testing.assert_allclose(predicted, steady, rtol=1e-12)


def test_position_speed_and_acceleration_reach_the_solution_of_the_riccati_equation() -> None:
    motion = MotionModel(0.9, 3.0)
    bank = FilterBank(LocalizerSettings(motion=motion, ranging=RangeModel(bias_m=0.0)))
    bank.place(np.array(True), 0.0, 10.0, 0.0, 10.0)
    for _ in range(1200):
        bank.predict(0.1, 0.0, False)
        predicted = bank.p[:3, :3, 0].copy()
        bank.take([(S, None)], 0.0, 0.05, ALL)
    transition, added = singer(0.1, motion)
    expected = solve_discrete_are(transition.T, np.eye(3)[:, :1], added, np.array([[0.05]]))
    np.testing.assert_allclose(predicted, expected, rtol=1e-8)


def test_a_constant_bias_is_not_averaged_away() -> None:
    bank = FilterBank(LocalizerSettings(ranging=RangeModel(bias_m=0.4)))
    bank.place(np.array(True), 0.0, 100.0, 0.0, 1.0)
    for count in range(1, 1001):
        bank.take([(S, None), (RANGE_BIAS, None)], 0.0, 0.09, ALL)
        if count in (1, 10, 1000):
            expected = 1.0 / (1.0 / 100.0**2 + 1.0 / (0.4**2 + 0.09 / count))
            np.testing.assert_allclose(bank.variances[S], expected, rtol=1e-9)


def test_standing_still_the_bias_stays_and_running_it_is_renewed_with_the_way() -> None:
    settings = LocalizerSettings(ranging=RangeModel(bias_m=0.4, bias_length_m=100.0))
    for speed_mps, expected in ((0.0, 0.4), (20.0, 0.4 * np.exp(-1.0))):
        bank = FilterBank(settings)
        bank.place(np.array(True), 0.0, 1.0, speed_mps, 1e-3)
        bank.x[RANGE_BIAS] = 0.4
        for _ in range(50):
            bank.x[V] = speed_mps
            bank.predict(0.1, 0.0, False)
        np.testing.assert_allclose(bank.x[RANGE_BIAS], expected, rtol=1e-12)
    bank.predict(0.1, 0.0, True)
    assert not bank.x[RANGE_BIAS].any()
    np.testing.assert_allclose(bank.variances[RANGE_BIAS], 0.16)
    assert not bank.p[RANGE_BIAS, :RANGE_BIAS].any()


def test_by_wheels_alone_the_uncertainty_grows_with_the_way() -> None:
    wheels = OdometerModel(
        noise_mps=1e-3, scale=0.01, scale_length_m=inf, creep=0.0, creep_mps=1e-4
    )
    settings = LocalizerSettings(odometer=wheels)
    bank, model = FilterBank(settings), MeasurementModel(settings)
    bank.place(np.array(True), 0.0, 0.5, 20.0, 30.0)
    for tick in range(1, 2001):
        bank.predict(0.1, 1e-4, False)
        model.odometer(bank, WheelSpeed(20.0, 0.0), 20.0, USES[Sensor.ODOMETER])
        if tick in (500, 2000):
            distance_m = 2.0 * tick
            sigma_m = np.sqrt(bank.variances[S][USES[Sensor.ODOMETER]])
            np.testing.assert_allclose(sigma_m, np.hypot(0.5, 0.01 * distance_m), rtol=2e-2)


def random_reading(
    rng: np.random.Generator, tick: int
) -> tuple[list[tuple[int, float]], float, float]:
    """Return a row, a reading and the variance of its noise."""
    states = rng.choice(STATES, size=3, replace=False)
    row = [(int(state), float(c)) for state, c in zip(states, rng.normal(size=3), strict=True)]
    return row, float(rng.normal()), float(10.0 ** rng.uniform(-2.0, 3.0 if tick else -2.0))


def test_it_is_the_filter_that_the_textbook_has() -> None:
    settings = LocalizerSettings()
    bank, rng = FilterBank(settings), np.random.default_rng(3)
    bank.place(np.array(True), 0.0, 30.0, 20.0, 5.0)
    x, p = bank.x[:, 0].copy(), bank.p[:, :, 0].copy()
    settled = np.zeros(STATES)
    settled[3:] = [settings.odometer.scale**2, 0.5**2, settings.ranging.bias_m**2, 1.0]
    for tick in range(60):
        bank.predict(0.1, 0.5, False)
        transition, added = singer(0.1, settings.motion)
        distance_m = 0.1 * abs(x[V])
        kept = np.exp(
            [
                -distance_m / settings.odometer.scale_length_m,
                -0.1 / settings.odometer.correlation_s,
                -distance_m / settings.ranging.bias_length_m,
                -distance_m / settings.doppler.length_m,
            ]
        )
        whole = np.diag([1.0, 1.0, 1.0, *kept])
        whole[:3, :3] = transition
        noise = np.diag([0.0, 0.0, 0.0, *(settled[3:] * (1.0 - kept**2))])
        noise[:3, :3] = added
        x, p = whole @ x, whole @ p @ whole.T + noise

        row, reading, variance = random_reading(rng, tick)
        h = np.zeros(STATES)
        for state, coefficient in row:
            h[state] = coefficient
        reading += float(h @ x)
        bank.take(row, reading, variance, ALL)
        gain = p @ h / (h @ p @ h + variance)
        x = x + gain * (reading - h @ x)
        josephs = np.eye(STATES) - np.outer(gain, h)
        p = josephs @ p @ josephs.T + variance * np.outer(gain, gain)
        np.testing.assert_allclose(bank.x[:, 0], x, rtol=1e-9, atol=1e-9)
        scale = np.sqrt(np.outer(np.diag(p), np.diag(p)))
        np.testing.assert_allclose(bank.p[:, :, 0] / scale, p / scale, atol=1e-9)


def test_covariances_stay_symmetric_and_positive_definite() -> None:
    settings = LocalizerSettings()
    bank, model, rng = (
        FilterBank(settings, (3,)),
        MeasurementModel(settings),
        np.random.default_rng(5),
    )
    on, zero = np.ones((3, 1), np.bool_), np.zeros((3, 1))
    for tick in range(600):
        bank.predict(0.1, float(10.0 ** rng.uniform(-3, 1)), bool(tick % 97 == 0))
        chosen = rng.uniform(size=4)
        if chosen[0] < 0.5:
            fix = RangeFix(zero, zero + 1e-6, zero + 0.3, zero, on)
            model.range(bank, fix, np.broadcast_to(USES[Sensor.RANGE], (3, 11)))
        if chosen[1] < 0.3:
            correlation = 0.999999
            doppler = DopplerFix(
                zero, zero, zero + 2500.0, zero + 500.0 * correlation, zero + 100.0, zero, on
            )
            model.doppler(bank, doppler, np.broadcast_to(USES[Sensor.DOPPLER], (3, 11)))
        if chosen[2] < 0.1:
            block = BlockEntry(zero, zero, on)
            model.block(bank, block, np.broadcast_to(USES[Sensor.BLOCK], (3, 11)))
        if chosen[3] < 0.9:
            wheels = WheelSpeed(zero, zero, on)
            model.odometer(bank, wheels, 0.0, np.broadcast_to(USES[Sensor.ODOMETER], (3, 11)))
        bank.lose()
        np.testing.assert_array_equal(bank.p, bank.p.swapaxes(0, 1))
        if tick % 20 == 0:
            p = np.moveaxis(bank.p, (0, 1), (-2, -1))
            sigma = np.sqrt(np.einsum("...ii->...i", p))
            correlation_matrix = p / (sigma[..., :, None] * sigma[..., None, :])
            assert np.linalg.eigvalsh(correlation_matrix).min() > 0.0


def draw(rng: np.random.Generator, covariance: np.ndarray, runs: int) -> np.ndarray:
    """Return normal vectors [state, runs] of a covariance that may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    scaled = vectors * np.sqrt(np.maximum(values, 0.0))
    return scaled @ rng.standard_normal((len(values), runs))


def test_errors_are_as_large_as_the_covariance_says() -> None:
    """Normalised errors squared of all filters, and of innovations, against chi-square laws."""
    runs, ticks, rng = 600, 41, np.random.default_rng(11)
    settings = replace(
        LocalizerSettings(),
        block=BlockModel(detection_s=0.0),
        doppler=DopplerModel(correlated=0.8, length_m=inf),
        ranging=RangeModel(bias_m=0.5, bias_length_m=inf),
        odometer=OdometerModel(scale_length_m=inf),
    )
    bank, model = FilterBank(settings, (runs,)), MeasurementModel(settings)
    place = np.ones(runs, np.bool_)
    prior = np.diag([4.0, 0.25, 1.0, 0.02**2, 0.0, 0.25, 0.64])
    prior[A, A] = settings.motion.acceleration_mps2**2
    truth = draw(rng, prior, runs)
    truth[S] += 1000.0
    truth[V] += 20.0
    bank.place(place, np.full((runs, 1), 1000.0), 2.0, 20.0, 0.5)
    slip_mps, kept = 0.3, np.exp(-0.1 / settings.odometer.correlation_s)
    transition, added = singer(0.1, settings.motion)
    on, zero = np.ones((runs, 1), np.bool_), np.zeros((runs, 1))
    squared: dict[Sensor, list[np.ndarray]] = {sensor: [] for sensor in Sensor}
    for tick in range(ticks):
        bank.predict(0.1, slip_mps, False)
        truth[:3] = transition @ truth[:3] + draw(rng, added, runs)
        fresh = slip_mps * np.sqrt(1.0 - kept**2) * rng.standard_normal(runs)
        truth[SLIP] = kept * truth[SLIP] + fresh
        s, v, _, k, u, b, d = truth[:, :, None]
        noise = rng.standard_normal((5, runs, 1))
        outcomes = {
            Sensor.ODOMETER: model.odometer(
                bank,
                WheelSpeed(v + k * 20.0 + u + 0.05 * noise[0], zero, on),
                20.0,
                np.broadcast_to(USES[Sensor.ODOMETER], (runs, 11)),
            ),
            Sensor.RANGE: model.range(
                bank,
                RangeFix(s + b + 0.3 * noise[1], zero + 0.09, zero, zero, on),
                np.broadcast_to(USES[Sensor.RANGE], (runs, 11)),
            ),
        }
        if tick % 3 == 0:
            variance, mixed, speed = 9.0, 1.2, 0.25
            lower = np.linalg.cholesky([[variance, mixed], [mixed, speed]])
            error = np.einsum("ij,jrk->irk", lower, noise[2:4])
            fix = DopplerFix(
                s + 3.0 * d + error[0],
                v + mixed / 3.0 * d + error[1],
                *(zero + variance, zero + mixed, zero + speed, zero, on),
            )
            use = np.broadcast_to(USES[Sensor.DOPPLER], (runs, 11))
            outcomes[Sensor.DOPPLER] = model.doppler(bank, fix, use)
        if tick % 20 == 0:
            entry = BlockEntry(s + settings.block.survey_m * noise[4], zero, on)
            use = np.broadcast_to(USES[Sensor.BLOCK], (runs, 11))
            outcomes[Sensor.BLOCK] = model.block(bank, entry, use)
        for sensor, outcome in outcomes.items():
            for row in outcome:
                squared[sensor].append((row.innovation**2 / row.variance)[:, 0])

    error = np.moveaxis(bank.x - truth[:, :, None], 0, -1)
    p = np.moveaxis(bank.p, (0, 1), (-2, -1))
    nees = np.einsum("...i,...i->...", error, np.linalg.solve(p, error[..., None])[..., 0])
    low, high = np.array(stats.chi2.interval(1.0 - 1e-4, STATES * runs)) / runs
    mean = nees.mean(axis=0)
    assert (low < mean).all(), mean
    assert (mean < high).all(), mean
    for sensor, parts in squared.items():
        nis = np.concatenate(parts)
        low, high = np.array(stats.chi2.interval(1.0 - 1e-4, nis.size)) / nis.size
        assert low < nis.mean() < high, sensor


def test_the_difference_of_two_filters_has_the_difference_of_their_variances() -> None:
    """What the tests for faults rest on: ``var(x_sub - x_full) = P_sub - P_full``."""
    runs, rng = 1000, np.random.default_rng(2)
    settings = LocalizerSettings(block=BlockModel(detection_s=0.0, survey_m=0.5))
    bank, model = FilterBank(settings, (runs,)), MeasurementModel(settings)
    bank.place(np.ones(runs, np.bool_), np.zeros((runs, 1)), 2.0, 20.0, 0.5)
    s = 2.0 * rng.standard_normal((runs, 1))
    v = 20.0 + 0.5 * rng.standard_normal((runs, 1))
    b = settings.ranging.bias_m * rng.standard_normal((runs, 1))
    k = settings.odometer.scale * rng.standard_normal((runs, 1))
    on, zero = np.ones((runs, 1), np.bool_), np.zeros((runs, 1))
    # The present only, so that nothing but the readings is random.
    for _ in range(20):
        noise = rng.standard_normal((3, runs, 1))
        wheels = WheelSpeed(v + 20.0 * k + 0.05 * noise[0], zero, on)
        model.odometer(bank, wheels, 20.0, np.broadcast_to(USES[Sensor.ODOMETER], (runs, 11)))
        fix = RangeFix(s + b + 0.3 * noise[1], zero + 0.09, zero, zero, on)
        model.range(bank, fix, np.broadcast_to(USES[Sensor.RANGE], (runs, 11)))
        entry = BlockEntry(s + 0.5 * noise[2], zero, on)
        model.block(bank, entry, np.broadcast_to(USES[Sensor.BLOCK], (runs, 11)))
    for child in range(1, len(FILTERS)):
        gained = (bank.variances[S, :, child] - bank.variances[S, :, 0]).mean()
        apart = bank.x[S, :, child] - bank.x[S, :, 0]
        if gained < 1e-6:
            assert np.abs(apart).max() < 1e-6
            continue
        low, high = np.array(stats.chi2.interval(1.0 - 1e-4, runs)) / runs
        assert low < np.mean(apart**2) / gained < high, FILTERS[child]


def test_one_train_is_one_of_many_runs() -> None:
    """The compiled filters of one train beside whole arrays, and beside their plain form."""
    rng = np.random.default_rng(8)
    settings = LocalizerSettings()
    alone, many = FilterBank(settings), FilterBank(settings, (3,))
    plain = FilterBank(settings)
    everywhere = np.ones(3, dtype=np.bool_)
    for bank in (alone, plain):
        bank.place(np.array(True), 1000.0, 2.0, 20.0, 0.1)
    many.place(everywhere, 1000.0, 2.0, 20.0, 0.1)
    for tick in range(60):
        slip_mps, anew = float(rng.uniform(0.0, 0.5)), bool(tick % 20 == 10)
        row: MeasurementRow = [(S, None), (V, -0.3), (RANGE_BIAS, None)]
        if tick % 2:
            row = [(V, None), (SCALE, np.array([21.0])), (SLIP, None)]
        near = float(many.x[V if tick % 2 else S, 0, 0])
        reading = near + float(rng.normal(scale=0.1)) + (40.0 if tick in (30, 31) else 0.0)
        use = rng.uniform(size=len(FILTERS)) < 0.8
        many.predict(0.25, np.full((3, 1), slip_mps), np.full((3, 1), anew))
        expected = many.take(row, np.full((3, 1), reading), 0.04, np.stack([use] * 3))
        with pytest.MonkeyPatch.context() as patch:
            alone.predict(0.25, slip_mps, anew)
            outcome = alone.take(row, reading, 0.04, use)
            for kernel in (predict_filters, take_scalar):
                patch.setattr(filter_bank, kernel.__name__, kernel.py_func)  # type: ignore[attr-defined]
            plain.predict(0.25, slip_mps, anew)
            plain.take(row, reading, 0.04, use)
        np.testing.assert_allclose(outcome.innovation, expected.innovation[0], atol=1e-9)
        np.testing.assert_allclose(outcome.variance, expected.variance[0], rtol=1e-9)
        assert (outcome.refused is None) == (expected.refused is None)
        assert outcome.refused is not None or tick not in (30, 31)
        if outcome.refused is not None and expected.refused is not None:
            np.testing.assert_array_equal(outcome.refused, expected.refused[0])
        for bank in (alone, plain):
            np.testing.assert_allclose(bank.x, many.x[:, 0], rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(bank.p, many.p[:, :, 0], rtol=1e-9, atol=1e-9)
            np.testing.assert_array_equal(bank.p, bank.p.swapaxes(0, 1))


def test_what_lasts_in_ranges_is_not_averaged_away() -> None:
    """A clock that is wrong shifts all ranges alike: the claim holds a shift of 4 of its sigmas."""
    rng = np.random.default_rng(5)
    localizer = Localizer(LocalizerSettings())
    lasting_m, start_m, speed_mps = 1.5, 1000.0, 11.0
    for tick in range(400):
        true_m = start_m + speed_mps * 0.1 * tick
        told_m = true_m + 4.0 * lasting_m + lasting_m * rng.standard_normal()
        readings = TickMeasurements(
            range=RangeFix(told_m, lasting_m**2, 0.0, lasting_m=lasting_m),
            odometer=WheelSpeed(speed_mps + 0.02 * rng.standard_normal(), 0.0),
        )
        here = localizer.tick(0.1 * tick, readings)
        assert here.low_m <= true_m <= here.high_m, tick
