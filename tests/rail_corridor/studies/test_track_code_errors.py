"""Errors of the track-code receivers as a calculation, and the studies that come with it."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest
from pydantic import ValidationError

from rail_corridor.studies import track_code_errors
from rail_corridor.studies.registry import CALCULATIONS, FOLDER
from rail_corridor.studies.track_code_errors import (
    TrackCodeErrorParameters,
    count_track_code_errors,
)
from rail_corridor.study.cells import cells_of
from rail_corridor.study.model import Study
from rail_corridor.yaml_file import load_yaml
from rail_signals.track_code.profile import TrackCodeProfile, load_profile
from rail_signals.track_code.study.closed_forms import message_error_rate
from rail_signals.track_code.study.error_count import ErrorCount
from rail_signals.track_code.study.receivers import COUNTERS, Receiver

STUDIES = sorted({path.stem for path in FOLDER.glob("track_code_*.yaml")} - {"track_code_runs"})


def count(seed: int = 1, **parameters: Any) -> dict[str, float | None]:
    return dict(count_track_code_errors(TrackCodeErrorParameters(**parameters), seed))


def test_every_receiver_is_there() -> None:
    assert get_args(Receiver) == tuple(COUNTERS)


def test_a_run_depends_on_its_seed_alone() -> None:
    first, again, other = (count(seed, density_db_hz=30.0, messages=500) for seed in (1, 1, 2))
    assert first == again
    assert first != other
    assert first["messages"] == 500
    assert 0.15 < (first["errors"] or 0.0) / 500 < 0.45


@pytest.mark.parametrize("receiver", COUNTERS)
def test_figures_are_those_of_the_receiver(
    monkeypatch: pytest.MonkeyPatch, receiver: Receiver
) -> None:
    asked: list[tuple[TrackCodeProfile, float, int]] = []

    def counter(
        profile: TrackCodeProfile, density_db_hz: float, messages: int, _: np.random.Generator
    ) -> ErrorCount:
        asked.append((profile, density_db_hz, messages))
        return ErrorCount(12, 5, undetected=3)

    monkeypatch.setattr(track_code_errors, "COUNTERS", {**COUNTERS, receiver: counter})
    found = count(receiver=receiver, density_db_hz=28.0, messages=11, deviation_scale=0.5)
    ((profile, density_db_hz, messages),) = asked
    whole = load_profile("tones27").deviations_hz
    assert profile.deviations_hz == tuple(0.5 * each for each in whole)
    assert (density_db_hz, messages) == (28.0, 11)
    bound = message_error_rate(profile, 28.0)
    assert 1e-3 < bound < 1e-1
    assert found == {"messages": 12, "errors": 5, "undetected": 3, "bound": bound}


def test_what_is_made_of_noise_alone_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    expected = {"messages": 400, "errors": 0, "undetected": 0, "bound": 2.0**-6}
    assert count(receiver="noise_only", messages=400) == expected
    counted = ErrorCount(500, 2, undetected=2)
    monkeypatch.setattr(track_code_errors, "count_noise_only", lambda *_: counted)
    expected = {"messages": 500, "errors": 2, "undetected": 2, "bound": 2.0**-6}
    assert count(receiver="noise_only", messages=400) == expected


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"density_db_hz": 30.0, "threshold": True}, "Extra inputs"),
        ({"receiver": "near"}, "a value is needed for near"),
        ({"receiver": "noise_only", "density_db_hz": 30.0}, "has no carrier"),
        ({"receiver": "far", "density_db_hz": 30.0}, "Input should be"),
        ({"density_db_hz": 5.0}, "greater than or equal to 15"),
        ({"density_db_hz": 30.0, "deviation_scale": 0.0}, "greater than or equal to 0.05"),
        ({"density_db_hz": 30.0, "messages": 0}, "greater than or equal to 1"),
    ],
)
def test_what_cannot_be_is_refused(parameters: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        TrackCodeErrorParameters(**parameters)


@pytest.mark.parametrize("density_db_hz", [15.0, 60.0])
@pytest.mark.parametrize("deviation_scale", [0.05, 2.0])
def test_the_ends_of_the_ranges_can_be_counted(
    density_db_hz: float, deviation_scale: float
) -> None:
    for receiver in ("near", "chain_bits", "chain_lost"):
        found = count(
            receiver=receiver,
            density_db_hz=density_db_hz,
            deviation_scale=deviation_scale,
            messages=10,
        )
        assert found["messages"] == 10
        assert 0.0 <= (found["bound"] or 0.0) <= 1.0


@pytest.mark.parametrize("name", STUDIES)
def test_the_cells_of_the_studies_can_be_run(name: str) -> None:
    study = Study.model_validate(load_yaml(FOLDER / f"{name}.yaml"))
    assert study.calculation is not None
    for values in cells_of(study):
        CALCULATIONS[study.calculation].check({**study.parameters, **values}, study.first_seed)


def test_the_studies_are_those_of_the_document() -> None:
    assert STUDIES == [
        "track_code_deviations",
        "track_code_errors",
        "track_code_undetected",
    ]
