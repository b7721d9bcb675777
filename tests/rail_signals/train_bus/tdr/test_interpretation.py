"""From traces to faults: one of each kind, healthy trains, single runs, verdicts."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rail_signals.train_bus.bus_line import BusLine, CableSection, Coupler, Stub, Termination
from rail_signals.train_bus.consist import CarRun, Consist, Deviations, Tolerances
from rail_signals.train_bus.faults import (
    KINDS,
    BadSplice,
    BusFault,
    LooseConnector,
    MissingShieldGround,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
    WrongCable,
    place_of,
)
from rail_signals.train_bus.profile import load_bus_profile
from rail_signals.train_bus.study.campaign import HEALTHY, Case, draw_case, draw_fault, examine
from rail_signals.train_bus.study.detection_limits import detectable_size, fault_of_size
from rail_signals.train_bus.tdr.interpretation import interpret
from rail_signals.train_bus.tdr.reflectometer import (
    Reflectogram,
    Reflectometer,
    measure,
    measure_consist,
)
from rail_signals.train_bus.tdr.sequential_fit import Windows, fit_sequentially
from rail_signals.train_bus.tdr.single_cable import read_single_cable
from rail_signals.train_bus.tdr.verdict import RunMeasurement, judge, judge_train

CM2, CM4 = load_bus_profile("CM2"), load_bus_profile("CM4")
PROFILES = [CM2, load_bus_profile("CM3"), CM4]
CABLE = CM2.cable
TRAIN = Consist(
    tuple(CarRun(CABLE, profile.length_m) for profile in PROFILES),
    Stub(CableSection(CABLE, 0.4), Termination(10e3), 30e-12),
    Coupler(0.02, 80e-9, 10e-12),
    Termination(105.0),
)
BUILT = Deviations.draw(3, np.random.default_rng(8))
INSTRUMENT = Reflectometer(reference_ohm=105.0)
FAULTS: list[BusFault] = [
    OpenCircuit(60.0),
    ShortCircuit(60.0, 2.0),
    WaterIngress(58.0, 6.0, 0.3, 2e-6),
    BadSplice(60.0, 4.0, 5e-8),
    WrongCable(1, load_bus_profile("example").cable),
    MissingShieldGround(1, 0.12, 0.3, 2.0),
    LooseConnector(0, 4.0, 5e-8, 0.6),
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.kind)
def test_each_kind(fault: BusFault) -> None:
    rng = np.random.default_rng(11)
    traces = measure_consist(TRAIN, BUILT, INSTRUMENT, rng, 4, fault)
    found = interpret(traces, TRAIN, INSTRUMENT)
    assert found.finding is not None
    assert found.finding.kind == fault.kind
    assert found.finding.place_m == pytest.approx(place_of(fault, TRAIN.bus_line()), abs=0.8)
    assert found.finding.probability > 0.9
    assert found.is_explained
    verdicts = judge_train(found, TRAIN, PROFILES)
    statuses = [verdict.status for verdict in verdicts]
    assert statuses[found.finding.car] == "fail"
    assert fault.kind in verdicts[found.finding.car].reasons[0]
    if fault.kind in ("open", "short"):
        assert statuses == ["pass", "fail", "not seen"]
        assert verdicts[1].measurement.attenuation_db == math.inf
    else:
        assert statuses.count("pass") == 2


def test_values_of_a_splice_are_measured() -> None:
    rng = np.random.default_rng(12)
    traces = measure_consist(TRAIN, BUILT, INSTRUMENT, rng, 4, BadSplice(60.0, 4.0, 5e-8))
    finding = interpret(traces, TRAIN, INSTRUMENT).finding
    assert finding is not None
    assert finding.values["resistance_ohm"] == pytest.approx(4.0, rel=0.1)
    assert finding.values["inductance_nh"] == pytest.approx(50.0, rel=0.4)
    assert 0.0 < finding.place_std_m < 0.3


def test_a_healthy_train_is_measured() -> None:
    """What the fit says of each car, against how it was built."""
    rng = np.random.default_rng(13)
    found = interpret(measure_consist(TRAIN, BUILT, INSTRUMENT, rng, 4), TRAIN, INSTRUMENT)
    assert found.finding is None
    assert found.noise_ratio == pytest.approx(1.0, abs=0.1)
    assert not found.is_changing
    sections = [e for e in TRAIN.bus_line(BUILT).elements if isinstance(e, CableSection)]
    for verdict, section in zip(judge_train(found, TRAIN, PROFILES), sections, strict=True):
        assert verdict.status == "pass"
        measured = verdict.measurement
        assert measured.length_m == pytest.approx(section.length_m * section.delay_factor, abs=0.15)
        assert measured.impedance_ohm == pytest.approx(section.impedance_ohm, rel=0.005)
        loss = float(section.cable.attenuation_db_per_m(1e6)) * section.length_m
        assert measured.attenuation_db == pytest.approx(loss, rel=0.06)


def test_costs_of_healthy_trains_are_chi_square() -> None:
    """Theory of the fit: as many degrees of freedom as samples, deviations or not."""
    excess = []
    for seed in range(12):
        rng = np.random.default_rng([14, seed])
        built = Deviations.draw(3, rng)
        trace = measure_consist(TRAIN, built, INSTRUMENT, rng).reflection[0]
        walked = fit_sequentially(
            Windows(TRAIN, INSTRUMENT, len(trace)), trace, INSTRUMENT.noise_rms
        )
        assert walked.failed is None and walked.healthy is not None
        excess.append(walked.healthy.excess)
    assert np.mean(excess) == pytest.approx(0.0, abs=0.9)
    assert np.std(excess) == pytest.approx(1.0, abs=0.65)


def short_train(kind: str, rng: np.random.Generator, cars: int) -> Case:
    """A case of the campaign with but a few cars, for the time it takes."""
    case = draw_case(HEALTHY, rng)
    consist = replace(case.consist, runs=case.consist.runs[:cars])
    cars = len(consist.runs)
    fault = draw_fault(kind, consist, rng)
    deviations = Deviations.draw(cars, rng)
    return replace(case, kind=kind, consist=consist, deviations=deviations, fault=fault)


def test_a_short_campaign() -> None:
    """The benchmark's campaign in little: every kind once, anywhere in a short train."""
    right = 0
    for number, kind in enumerate(KINDS):
        rng = np.random.default_rng([15, number])
        outcome = examine(short_train(kind, rng, 4), rng)
        assert outcome.reported != HEALTHY
        right += outcome.is_located and outcome.reported == kind
    assert right >= 6


def test_the_limit_of_detection() -> None:
    """A splice of twice the size that is nearly always found is found, one a tenth of it not."""
    found = []
    for seed in range(3):
        rng = np.random.default_rng([16, seed])
        case = short_train("bad_splice", rng, 3)
        state = rng.bit_generator.state
        size = detectable_size(case, rng, 0.99)
        for share in (2.0, 0.1):
            rng.bit_generator.state = state
            case = replace(case, fault=fault_of_size(case, share * size, rng))
            found.append(examine(case, rng).reported != HEALTHY)
    assert found == [True, False] * 3


@pytest.mark.parametrize(
    ("length_m", "factor", "end", "fault", "status", "told"),
    [
        (42.4, 1.0, math.inf, None, "pass", "open"),
        (51.2, 1.0, 0.0, None, "pass", "short"),
        (52.5, 1.0, math.inf, None, "fail", "open"),
        (47.0, 1.12, math.inf, None, "fail", "open"),
        (47.0, 1.0, 105.0, None, "pass", "matched"),
        (47.0, 1.0, 105.0, BadSplice(20.0, 6.0, 5e-8), "fail", "matched"),
        (47.0, 1.0, math.inf, WaterIngress(10.0, 6.0, 0.4), "fail", "open"),
        (47.0, 1.0, math.inf, ShortCircuit(31.0, 1.0), "fail", "short"),
    ],
)
def test_a_single_run(
    length_m: float, factor: float, end: float, fault: BusFault | None, status: str, told: str
) -> None:
    """Only the profile is known."""
    bus_line = BusLine((CableSection(CABLE, length_m, factor),), Termination(end))
    samples = INSTRUMENT.samples_for(60.0 / CABLE.velocity_m_per_s)
    traces = measure(bus_line, INSTRUMENT, np.random.default_rng(17), 4, fault, samples)
    reading = read_single_cable(traces, CM2, INSTRUMENT)
    assert reading.end == told
    assert reading.verdict.status == status, reading.verdict
    measured = reading.verdict.measurement
    if told != "matched":
        expected = 31.0 if isinstance(fault, ShortCircuit) else length_m
        assert measured.length_m == pytest.approx(expected, abs=0.05)
    assert measured.impedance_ohm == pytest.approx(105.0 * factor, rel=0.01)
    finding = reading.interpretation.finding
    if fault is not None and not isinstance(fault, ShortCircuit):
        assert finding is not None
        assert finding.kind == fault.kind
        assert finding.place_m == pytest.approx(place_of(fault, bus_line), abs=0.4)
    else:
        assert finding is None


@pytest.mark.parametrize(
    ("measurement", "status", "reason"),
    [
        ((47.0, 105.0, 0.5), "pass", None),
        ((42.3, 95.0, 14.999), "pass", None),
        ((51.7, 115.0, 0.0), "pass", None),
        ((42.29, 105.0, 0.5), "fail", "length 42.29 m outside 42.3 to 51.7 m"),
        ((51.71, 105.0, 0.5), "fail", "length 51.71 m outside 42.3 to 51.7 m"),
        ((47.0, 94.9, 0.5), "fail", "impedance 94.9 ohm outside 95 to 115 ohm"),
        ((47.0, 120.0, 0.5), "fail", "impedance 120 ohm outside 95 to 115 ohm"),
        ((47.0, 105.0, 15.0), "fail", "attenuation 15 dB not below 15 dB"),
        ((47.0, 105.0, math.inf), "fail", "attenuation inf dB not below 15 dB"),
        ((None, 105.0, 0.5), "not seen", "length not seen"),
    ],
)
def test_the_rules_of_the_tables(
    measurement: tuple[float | None, float, float], status: str, reason: str | None
) -> None:
    """S2, Fig 6, with "or" where it prints an impossible chain; 15 dB itself fails."""
    verdict = judge(RunMeasurement(*measurement), CM2)
    assert verdict.status == status
    assert verdict.reasons == (() if reason is None else (reason,))


def test_rules_of_cars_of_27_m_and_of_the_train_bus() -> None:
    assert judge(RunMeasurement(24.3, 105.0, 0.5), CM4).status == "pass"
    assert judge(RunMeasurement(24.2, 105.0, 0.5), CM4).status == "fail"
    assert judge(RunMeasurement(29.8, 105.0, 0.5), CM4).status == "fail"
    wtb = load_bus_profile("wtb")
    assert judge(RunMeasurement(100.0, 120.0, 1.0), wtb).status == "pass"
    assert judge(RunMeasurement(100.0, 120.0, 1.1), wtb).status == "fail"


def test_what_is_refused() -> None:
    traces = Reflectogram(np.arange(100) * 4e-9, np.zeros(100))
    with pytest.raises(ValueError, match=r"must be sampled every 5e-09 s, got 4e-09 s"):
        interpret(traces, TRAIN, INSTRUMENT)
    with pytest.raises(ValueError, match=r"kind must be one of .*'rust'"):
        draw_case("rust", np.random.default_rng(1))
    found = interpret(
        measure_consist(TRAIN, BUILT, INSTRUMENT, np.random.default_rng(1)), TRAIN, INSTRUMENT
    )
    with pytest.raises(ValueError, match=r"profiles must be 3, got 1"):
        judge_train(found, TRAIN, [CM2])
    assert Tolerances().roughness == 0.003
