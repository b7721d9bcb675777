"""Documents: links and names lead somewhere, generated parts can go stale and are noticed."""

from __future__ import annotations

import ast
import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
DOTTED = re.compile(
    r"(?<![\w./-])rail_(?:signals|msgs_py|world|wayside|onboard|corridor)(?:\.\w+)+"
)
TEST_FILE = re.compile(r"(?:\w+/)*test_\w+\.py")
#: Names of records in a recording, which look like modules.
RECORDS = {
    "rail_corridor.commands",
    "rail_corridor.begin",
    "rail_corridor.end",
    "rail_corridor.part",
    "rail_corridor.next",
}


def load_refresh() -> ModuleType:
    """Return docs/refresh.py as a module."""
    spec = importlib.util.spec_from_file_location("refresh", ROOT / "docs" / "refresh.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_links_within_the_project_lead_somewhere(path: Path) -> None:
    text = re.sub(r"```.*?```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
    broken = [
        target
        for target in targets
        if not re.match(r"[a-z]+:", target) and not (path.parent / target).exists()
    ]
    assert broken == []


def names_in(body: list[ast.stmt]) -> dict[str, list[ast.stmt]]:
    """Names that statements define, each with the body of its class."""
    names: dict[str, list[ast.stmt]] = {}
    for node in body:
        if isinstance(node, ast.ClassDef):
            names[node.name] = node.body
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            names[node.name] = []
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {target.id: [] for target in targets if isinstance(target, ast.Name)}
    return names


def leads_somewhere(dotted: str, root: Path = ROOT) -> bool:
    """Whether a dotted name is that of a package, a module, or of what one defines."""
    package, *rest = dotted.split(".")
    place = root / "src" / package / package
    while rest and (place / rest[0]).is_dir():
        place /= rest.pop(0)
    if not rest:
        return (place / "__init__.py").exists()
    if (module := place / f"{rest[0]}.py").exists():
        rest.pop(0)
    elif not (module := place / "__init__.py").exists():
        return False
    body = ast.parse(module.read_text(encoding="utf-8")).body
    for name in rest:
        names = names_in(body)
        if name not in names:
            return False
        body = names[name]
    return True


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda p: str(p.relative_to(ROOT)))
def test_names_of_modules_and_tests_lead_somewhere(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    dotted = {name for name in DOTTED.findall(text) if name not in RECORDS}
    assert [name for name in sorted(dotted) if not leads_somewhere(name)] == []
    places = (ROOT / "tests", ROOT / "examples")
    found = (test for place in places for test in place.rglob("test_*.py"))
    known = [test.relative_to(ROOT).as_posix() for test in found]
    tests = sorted(set(TEST_FILE.findall(text)))
    assert [t for t in tests if not any(f"/{k}".endswith(f"/{t}") for k in known)] == []


@pytest.mark.parametrize(
    ("dotted", "expected"),
    [
        ("rail_pkg.folder", True),
        ("rail_pkg.folder.module", True),
        ("rail_pkg.folder.module.Thing.method", True),
        ("rail_pkg.folder.module.CONSTANT", True),
        ("rail_pkg.folder.other", False),
        ("rail_pkg.folder.module.Thing.gone", False),
        ("rail_pkg.folder.module.Gone", False),
    ],
)
def test_a_name_that_leads_nowhere_is_noticed(tmp_path: Path, dotted: str, expected: bool) -> None:
    folder = tmp_path / "src" / "rail_pkg" / "rail_pkg" / "folder"
    folder.mkdir(parents=True)
    (folder / "__init__.py").touch()
    (folder.parent / "__init__.py").touch()
    source = "CONSTANT = 1\n\nclass Thing:\n    def method(self):\n        return 1\n"
    (folder / "module.py").write_text(source, encoding="utf-8")
    assert leads_somewhere(dotted, tmp_path) == expected


def test_the_index_names_every_document() -> None:
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    missing = [
        str(path.relative_to(ROOT / "docs"))
        for path in sorted((ROOT / "docs").rglob("*.md"))
        if path.name != "README.md" and f"({path.relative_to(ROOT / 'docs')})" not in index
    ]
    assert missing == []


def test_a_stale_part_is_noticed_and_refreshed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refresh = load_refresh()
    monkeypatch.setattr(refresh, "ROOT", tmp_path)
    (tmp_path / "docs").mkdir()
    page = tmp_path / "docs" / "page.md"
    page.write_text("# Page\n<!-- generated: os:getcwd -->\nold\n<!-- end of generated -->\ntail\n")
    monkeypatch.chdir(tmp_path)
    assert refresh.main(["--check"]) == 1
    assert "old" in page.read_text()
    assert refresh.main([]) == 0
    assert refresh.main(["--check"]) == 0
    assert page.read_text() == (
        f"# Page\n<!-- generated: os:getcwd -->\n{tmp_path}\n<!-- end of generated -->\ntail\n"
    )


def test_tables_of_a_study_come_from_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    refresh = load_refresh()
    monkeypatch.setattr(refresh, "ROOT", tmp_path)
    page, results = tmp_path / "PAGE.md", tmp_path / "kills.study"
    results.mkdir()
    other = "<!-- study: rail study threats; tables: 1 -->\n<!-- end of study -->\n"
    page.write_text(
        "a\n<!-- study: rail study kills --runs 3; tables: 2 -->\nold\n<!-- end of study -->\n"
        + other
    )
    (results / "journal.jsonl").write_text('{"name": "kills"}\n{"cell": 0}\n')
    tables = ("kills", " one  ", "kills, continued", " two", "", "kills, continued", " three")
    (results / "summary.txt").write_text("\n".join(tables))
    assert refresh.main(["--study", str(results)]) == 0
    text = page.read_text()
    assert "-->\n```\n one\n\n two\n```\n<!-- end" in text and text.endswith(other)
    assert refresh.main(["--check"]) == 0
