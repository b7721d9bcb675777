"""The pip distribution and the six ament packages say the same about themselves."""

from __future__ import annotations

import ast
import configparser
import re
import runpy
import sys
import xml.etree.ElementTree as ET
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from rail_corridor.equipment.registry import node_kinds

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")  # tomllib is Python 3.11
PACKAGES = sorted(path.parent.name for path in (ROOT / "src").glob("*/package.xml"))
SCRIPTS: dict[str, dict[str, tuple[str, str]]] = {
    "rail_corridor": {"rail": ("rail_corridor.cli.main", "main")}
}
for _kind in node_kinds().values():
    _module, _, _class = _kind.target.partition(":")
    SCRIPTS.setdefault(_module.split(".")[0], {})[_kind.name] = (_module, f"{_class}.main")


def project_value(key: str) -> str:
    """Return a plain string value of the [project] table."""
    match = re.search(rf'^{key} = "(.*)"$', PYPROJECT, re.MULTILINE)
    assert match, key
    return match[1]


def setup_arguments(package: str) -> dict[str, ast.expr]:
    """Return the keyword arguments of the setup() call of a package."""
    tree = ast.parse((ROOT / "src" / package / "setup.py").read_text(encoding="utf-8"))
    call = next(
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "setup"
    )
    return {keyword.arg: keyword.value for keyword in call.keywords if keyword.arg}


def entry_points(package: str) -> dict[str, str]:
    """Return the console scripts a package installs, name to target."""
    arguments = setup_arguments(package)
    if "entry_points" not in arguments:
        return {}
    scripts = ast.literal_eval(arguments["entry_points"]).get("console_scripts", ())
    return {name.strip(): target.strip() for name, target in (s.split("=") for s in scripts)}


@pytest.mark.parametrize("package", PACKAGES)
def test_version_licence_and_description_agree(package: str) -> None:
    manifest = ET.parse(ROOT / "src" / package / "package.xml").getroot()
    arguments = setup_arguments(package)
    assert manifest.get("format") == "3"
    assert manifest.findtext("name") == package
    assert manifest.findtext("version") == project_value("version")
    assert ast.literal_eval(arguments["version"]) == project_value("version")
    assert manifest.findtext("license") == project_value("license")
    assert ast.literal_eval(arguments["license"]) == project_value("license")
    assert manifest.findtext("description") == ast.literal_eval(arguments["description"])
    assert manifest.findtext("export/build_type") == "ament_python"


@pytest.mark.parametrize("package", PACKAGES)
def test_ament_index_marker_scripts_directory_and_typing(package: str) -> None:
    folder = ROOT / "src" / package
    assert (folder / "resource" / package).is_file()
    assert (folder / package / "py.typed").is_file()
    config = configparser.ConfigParser()
    config.read(folder / "setup.cfg")
    assert config["develop"]["script_dir"] == f"$base/lib/{package}"
    assert config["install"]["install_scripts"] == f"$base/lib/{package}"


@pytest.mark.parametrize("package", PACKAGES)
def test_every_command_of_a_package_is_installed(package: str) -> None:
    expected = {
        name: f"{module}:{call}" for name, (module, call) in SCRIPTS.get(package, {}).items()
    }
    assert entry_points(package) == expected
    for target in entry_points(package).values():
        assert callable(EntryPoint("command", target, "console_scripts").load())


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
@pytest.mark.parametrize("kind", node_kinds())
def test_every_node_starts_as_a_module(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(
        "rail_msgs_py.tick_node.run_node", lambda node: started.append(node.__name__)
    )
    module, _, name = node_kinds()[kind].target.partition(":")
    runpy.run_module(module, run_name="__main__")
    assert started == [name]


#: The rosdep key under which Ubuntu 24.04 has a module; one that is not here is a package of ROS,
#: or ours, and its own key.
ROSDEP_KEYS = {
    "cryptography": "python3-cryptography",
    "cycler": "python3-cycler",
    "fastapi": "python3-fastapi",
    # Has no key of its own, and neither have lz4 and zstandard: they come with this one.
    "jinja2": "python3-jinja2",
    "lz4": "mcap-ros2-support",
    "matplotlib": "python3-matplotlib",
    "mcap": "mcap-ros2-support",
    "numba": "python3-numba",
    "numpy": "python3-numpy",
    "orjson": "python3-orjson",
    "pydantic": "python3-pydantic",
    "pydantic_core": "python3-pydantic",
    "pytest": "python3-pytest",
    "rich": "python3-rich",
    "scipy": "python3-scipy",
    "typer": "python3-typer",
    "typing_extensions": "python3-typing-extensions",
    "uvicorn": "python3-uvicorn",
    "yaml": "python3-yaml",
    "zstandard": "mcap-ros2-support",
}
#: Modules without a key: README.md says where they come from.
WITHOUT_KEY = {"dask", "distributed", "nicegui", "pyinstrument"}


def imported_modules(package: str) -> set[str]:
    """Return the top names of what a package imports, in functions too, and loads by name."""
    imported = set()
    for path in (ROOT / "src" / package / package).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level:
                names = [node.module or ""]
            imported |= {name.partition(".")[0] for name in names}
    if package == "rail_corridor":
        imported |= {kind.target.partition(".")[0] for kind in node_kinds().values()}
    return imported - sys.stdlib_module_names - {package}


@pytest.mark.parametrize("package", PACKAGES)
def test_manifest_depends_on_what_is_imported_and_no_more(package: str) -> None:
    manifest = ET.parse(ROOT / "src" / package / "package.xml").getroot()
    declared = [element.text for element in manifest.findall("exec_depend")]
    needed = {ROSDEP_KEYS.get(name, name) for name in imported_modules(package) - WITHOUT_KEY}
    assert sorted(filter(None, declared)) == sorted(needed)


def test_what_rosdep_does_not_know_is_told() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    imported = {name for package in PACKAGES for name in imported_modules(package)}
    assert imported >= WITHOUT_KEY
    for name in WITHOUT_KEY:
        assert f"`{name}`" in readme


def test_the_workspace_takes_the_same_versions_from_pip_without_ros() -> None:
    listed = re.search(r"^dependencies = \[\n(.*?)^\]", PYPROJECT, re.MULTILINE | re.DOTALL)
    assert listed
    wanted = [each for each in re.findall(r'"([^"]+)"', listed[1]) if not each.startswith("ros-")]
    lines = (ROOT / "ros2_ws" / "requirements.txt").read_text(encoding="utf-8").splitlines()
    given = [line for line in lines if not line.startswith("#")]
    numpy = {"numpy>=2.0", "numpy>=1.26,<2"}
    assert {*given} - numpy == {*wanted} - numpy
    assert {*given, *wanted} >= numpy


def test_pyproject_maps_every_package_and_the_command() -> None:
    for package in PACKAGES:
        assert f'"src/{package}",' in PYPROJECT
    assert 'rail = "rail_corridor.cli.main:main"' in PYPROJECT


def test_workspace_source_is_a_relative_link() -> None:
    link = ROOT / "ros2_ws" / "src"
    assert link.is_symlink()
    assert link.readlink() == Path("../src")
    assert link.resolve() == ROOT / "src"
