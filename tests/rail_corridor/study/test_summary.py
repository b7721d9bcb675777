"""Summaries: what was measured, what is theory alone, and what the end of a run has cut off."""

from __future__ import annotations

from pathlib import Path

import pytest

from rail_corridor.study.figures import Figure
from rail_corridor.study.journal import Entry
from rail_corridor.study.model import Study
from rail_corridor.study.picture import draw_study
from rail_corridor.study.summary import groups_of, is_cut_off, is_theory_alone, write_summary

STUDY = Study(
    name="margin",
    generator="link_margin",
    group_by=("level_db", "scheme"),
    figures={
        "per_h": Figure(over_runs="rate", per="hours"),
        "per_h_told": Figure(beside="per_h"),
        "wait_s": Figure(cut_off_by="cut_off"),
        "cut_off": Figure(over_runs="sum"),
        "hours": Figure(over_runs="sum"),
        **{f"another_figure_{n}_per_h": Figure(of="wait_s") for n in range(4)},
    },
)


def runs(level_db: float, seen: float, told: float, cut_off: float) -> list[Entry]:
    others = {f"another_figure_{n}_per_h": 1234.5 + n for n in range(4)}
    return [
        Entry(
            0,
            run,
            run + 1,
            {"level_db": level_db, "scheme": "alamouti_2x2"},
            {},
            {
                "per_h": seen,
                "per_h_told": told,
                "wait_s": 25.0 + run,
                "cut_off": cut_off,
                "hours": 0.5,
                **others,
            },
            None,
            0.1,
        )
        for run in range(6)
    ]


ENTRIES = [*runs(8.0, 3.0, 123.4, 2.0), *runs(20.0, 0.0, 4.5e-11, 0.0)]


def test_what_no_run_saw_is_marked_as_theory_and_what_was_cut_off_as_a_bound(
    tmp_path: Path,
) -> None:
    groups = groups_of(ENTRIES, STUDY.columns, STUDY.figures)
    told, wait = STUDY.figures["per_h_told"], STUDY.figures["wait_s"]
    assert [is_theory_alone(group, told) for group in groups] == [False, True]
    assert [is_cut_off(group, wait) for group in groups] == [True, False]
    write_summary(tmp_path / "summary.txt", STUDY, groups)
    text = (tmp_path / "summary.txt").read_text()
    frequent, rare, *_ = (line for line in text.splitlines() if "alamouti" in line)
    assert " 123 " in frequent and "(4.5e-11)" in rare
    assert "\u2265 27.5" in frequent and "\u2265" not in rare
    assert "(in brackets): theory alone, the runs saw none" in text
    assert "\u2265 lower bound: the end of the run has cut some off" in text
    assert "theory" in text.split("alamouti")[0]


def test_the_text_of_a_summary_fits_80_columns(tmp_path: Path) -> None:
    write_summary(tmp_path / "t", STUDY, groups_of(ENTRIES, STUDY.columns, STUDY.figures))
    lines = (tmp_path / "t").read_text().splitlines()
    assert max(map(len, lines)) <= 80
    for name in STUDY.figures:  # nothing is left out, and nothing cut
        assert all(any(part in line for line in lines) for part in name.split("_"))
    assert not any("\u2026" in line for line in lines)


@pytest.mark.parametrize(("seen", "styles"), [(3.0, {"--"}), (0.0, {":"})])
def test_theory_is_dotted_where_nothing_was_measured(
    seen: float, styles: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.axes import Axes

    drawn: list[str] = []
    plot = Axes.plot

    def spy(self: Axes, *arguments: object, **more: object) -> object:
        drawn.extend(each for each in arguments if each in ("--", ":"))
        return plot(self, *arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(Axes, "plot", spy)
    entries = [*runs(8.0, seen, 4.0, 0.0), *runs(20.0, seen, 2.0, 0.0)]
    groups = groups_of(entries, STUDY.columns, STUDY.figures)
    draw_study(tmp_path / "summary.png", STUDY, groups, ["per_h"])
    assert set(drawn) == styles
