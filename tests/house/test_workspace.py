"""The colcon workspace: the six packages build, and their entry points land where ROS looks."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.system
def test_colcon_builds_the_workspace(tmp_path: Path) -> None:
    colcon = shutil.which("colcon", path=str(Path(sys.executable).parent))
    if colcon is None:
        pytest.skip("colcon is not installed beside this Python")
    shutil.copytree(
        ROOT / "src", tmp_path / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info")
    )
    (tmp_path / "ws").mkdir()
    (tmp_path / "ws" / "src").symlink_to("../src")
    env = {
        **{k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "COLCON_HOME")},
        "HOME": str(tmp_path),
        "PATH": os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]),
    }
    build = subprocess.run(
        [colcon, "build", "--parallel-workers", "1"],
        cwd=tmp_path / "ws",
        env=env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )
    assert build.returncode == 0, build.stdout + build.stderr
    assert "Summary: 7 packages finished" in build.stdout
    install = tmp_path / "ws" / "install"
    for package, script in (
        ("rail_world", "world"),
        ("rail_world", "radio_medium"),
        ("rail_wayside", "wrs"),
        ("rail_wayside", "zone_controller"),
        ("rail_onboard", "vrs"),
        ("rail_corridor", "rail"),
    ):
        assert os.access(install / package / "lib" / package / script, os.X_OK)
    for package in (path.name for path in (ROOT / "src").iterdir() if path.is_dir()):
        share = install / package / "share"
        assert (share / package / "package.xml").is_file()
        assert (share / "ament_index" / "resource_index" / "packages" / package).is_file()
    assert list(
        install.glob("rail_corridor/lib/python*/site-packages/**/loading/builtin/demo.yaml")
    )
