"""Trains put together from profiles, and faults in words."""

from __future__ import annotations

import math

import pytest

from rail_signals.train_bus.cable_constants import longest_stub_m
from rail_signals.train_bus.fault_words import SIZES, fault_words, size_of
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.tdr.interpretation import Finding
from rail_signals.train_bus.train import STUB_M, cable_consist, train_consist, train_profiles


def test_a_train_is_its_cars_in_their_order() -> None:
    consist = train_consist(("CM4", "cm2"))
    assert [run.length_m for run in consist.runs] == [27.0, 47.0]
    assert consist.starts_m.tolist() == [0.0, 27.0, 74.0]
    assert consist.termination.resistance_ohm == 105.0
    assert consist.node is not None
    assert train_profiles(("wtb",))[0].termination_ohm == 120.0


def test_a_cable_by_itself_has_no_node() -> None:
    consist = cable_consist("CM4")
    assert (consist.length_m, consist.node) == (27.0, None)


def test_the_stub_is_longer_than_the_rule_of_thumb_and_shorter_than_in_service() -> None:
    assert float(longest_stub_m(13e-9, 1.282e8)) < STUB_M < 1.0


@pytest.mark.parametrize(
    ("cars", "bus_line"), [((), "cars must name one profile"), (("CM9",), "got 'CM9'")]
)
def test_what_is_no_train(cars: tuple[str, ...], bus_line: str) -> None:
    with pytest.raises(ValueError, match=bus_line):
        train_consist(cars)


def test_every_kind_of_fault_has_words_and_a_size() -> None:
    assert set(SIZES) == set(KINDS)
    for kind in KINDS:
        name, unit, _ = SIZES[kind]
        finding = Finding(kind, 0, 3.0, 0.1, {name: 0.5}, 1.0)
        expected = math.nan if not name else math.expm1(0.5) if "log" in name else 0.5
        assert size_of(finding) == pytest.approx(expected, nan_ok=True)
        words = fault_words(kind, 0, 3.04, size_of(finding))
        assert words.startswith(kind.replace("_", " "))
        assert "car 1 at 3.0 m" in words
        assert words.endswith(unit or "3.0 m")
    assert fault_words("bad_splice", 1, 94.0, 1234.0) == "bad splice in car 2 at 94.0 m, 1200 ohm"
