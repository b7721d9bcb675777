"""The faults of ``tests/mutants.py``: each still applies, and one that nobody notices is told.

That each is noticed is a check of its own, which runs the script.
"""

from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest
import yaml

from ..mutants import MUTANTS, Mutant, Verdict, conclude

ROOT = Path(__file__).resolve().parents[2]


def ids(mutant: Mutant) -> str:
    """Return the name of a fault."""
    return mutant.name


def meaning(mutant: Mutant, text: str) -> Any:
    """Return what the file of a fault says."""
    return yaml.safe_load(text) if mutant.file.endswith(".yaml") else ast.dump(ast.parse(text))


@pytest.mark.parametrize("mutant", MUTANTS, ids=ids)
def test_a_fault_applies_once_and_its_tests_are_there(mutant: Mutant) -> None:
    text = (ROOT / "src" / mutant.file).read_text(encoding="utf-8")
    faulty = mutant.applied_to(text)
    assert meaning(mutant, faulty) != meaning(mutant, text), "it changes nothing"
    assert mutant.tests
    for test in mutant.tests:
        path, _, name = test.partition("::")
        tree = ast.parse((ROOT / "tests" / path).read_text(encoding="utf-8"))
        names = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert not name or name in names, f"{path} has no {name}"


def test_there_are_enough_and_each_has_a_name_of_its_own() -> None:
    assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS) >= 30


@pytest.mark.parametrize(("text", "times"), [("nothing of it", 0), ("half = 1\nhalf = 1", 2)])
def test_a_fault_that_no_longer_applies_is_refused(text: str, times: int) -> None:
    mutant = Mutant("halved", "a.py", "half = 1", "half = 2", ("test_a.py",))
    with pytest.raises(ValueError, match=f"^halved: a.py: {times} times: half = 1$"):
        mutant.applied_to(text)


@pytest.mark.parametrize(
    ("killed_by", "trouble", "broken", "code"),
    [
        ("test_a.py::test_it", "", "", 0),
        ("", "", "", 1),
        ("", "the tests ended with 2", "", 1),
        ("test_a.py::test_it", "", "FAILED test_b.py::test_it", 1),
    ],
)
def test_the_verdict(
    capsys: pytest.CaptureFixture[str], killed_by: str, trouble: str, broken: str, code: int
) -> None:
    noticed = Verdict(MUTANTS[0], "test_a.py::test_other", "", 0.1)
    verdict = Verdict(MUTANTS[1], killed_by, trouble, 0.1)
    assert conclude([noticed, verdict], broken) == code
    text = capsys.readouterr().out
    assert f"{1 + bool(killed_by)} of 2 mutants killed" in text
    assert trouble in text and broken in text
    assert str(verdict).split("  ")[-1] == (killed_by or ("TROUBLE" if trouble else "SURVIVED"))
