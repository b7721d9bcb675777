#!/usr/bin/env python3
"""Set up the project on first use, then hand every argument to ``rail``.

    python3 corridor.py                 runs the demo corridor
    python3 corridor.py run plain_line  any rail command (see --help)
    python3 corridor.py test            everything that continuous integration runs
    python3 corridor.py test -k NAME    only pytest, with these arguments

Needs CPython 3.10 to 3.13 with its standard library and, on first use, a package index for pip.
The packages go into ``.venv`` beside this file, in the versions that ``requirements.lock`` names.
"""

import sys

if not (3, 10) <= sys.version_info[:2] <= (3, 13):  # before anything an old Python would choke on
    sys.stderr.write(
        "corridor.py: needs Python 3.10 to 3.13, this is %d.%d (%s)\n"  # noqa: UP031
        % (sys.version_info[0], sys.version_info[1], sys.executable)
    )
    sys.exit(2)

import collections
import contextlib
import fcntl
import hashlib
import importlib.util
import os
import platform
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
LOCK_FILE = ROOT / "requirements.lock"
STAMP = VENV / "corridor.stamp"
STAMP_LAYOUT = "1"  # raise it when the way the environment is made changes


class SetupError(Exception):
    """Set-up cannot go on; the text is one line for the user."""


def say(line: str) -> None:
    """Report one step of the set-up on standard error, away from the output of ``rail``."""
    print(f"corridor.py: {line}", file=sys.stderr, flush=True)


def clean_environment() -> dict[str, str]:
    """Return the environment for ``.venv``: without what would shadow its packages.

    A shell that has sourced a ROS installation points PYTHONPATH and the library path at another
    rclpy; mixing the two builds ends in import errors.
    """
    env = dict(os.environ)
    foreign = [p for p in env.pop("AMENT_PREFIX_PATH", "").split(os.pathsep) if p]
    for name in ("PYTHONPATH", "PYTHONHOME", "PIP_REQUIRE_VIRTUALENV", "PIP_USER"):
        env.pop(name, None)
    if foreign and "LD_LIBRARY_PATH" in env:
        kept = [
            path
            for path in env["LD_LIBRARY_PATH"].split(os.pathsep)
            if path and not any(path == p or path.startswith(p + os.sep) for p in foreign)
        ]
        env["LD_LIBRARY_PATH"] = os.pathsep.join(kept)
    env["VIRTUAL_ENV"] = str(VENV)
    env["PATH"] = os.pathsep.join([str(VENV / "bin"), env.get("PATH", os.defpath)])
    return env


def digest(path: Path) -> str:
    """Return the SHA-256 of a file in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def wanted_stamp() -> dict[str, str]:
    """Return what a finished ``.venv`` of this checkout records about itself."""
    return {
        "layout": STAMP_LAYOUT,
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "base": os.path.realpath(sys.base_prefix),
        "root": str(ROOT),
        "lock": digest(LOCK_FILE),
        "project": digest(ROOT / "pyproject.toml"),
    }


def read_stamp() -> dict[str, str]:
    """Return the record of the existing ``.venv``; empty when it was never finished."""
    try:
        lines = STAMP.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    return dict(line.split("=", 1) for line in lines if "=" in line)


def write_stamp(stamp: dict[str, str]) -> None:
    """Record a finished set-up; the rename makes it all or nothing."""
    part = STAMP.with_suffix(".part")
    part.write_text("".join(f"{k}={v}\n" for k, v in stamp.items()), encoding="utf-8")
    part.replace(STAMP)


@contextlib.contextmanager
def only_one_setup() -> Iterator[None]:
    """Let one process at a time work on ``.venv``; the kernel frees the lock when it dies."""
    with open(ROOT / ".venv.lock", "w") as handle:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            say("another set-up is at work here, waiting for it")
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def run_pip(arguments: list[str]) -> None:
    """Run the pip of ``.venv`` quietly, with a count of the packages as the sign of life."""
    command = [str(VENV / "bin" / "python"), "-m", "pip", "--disable-pip-version-check"]
    command += ["--no-input", "install", "--progress-bar", "off", *arguments]
    tail: collections.deque[str] = collections.deque(maxlen=12)
    count = 0
    on_terminal = sys.stderr.isatty()
    with subprocess.Popen(
        command,
        env=clean_environment(),
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    ) as pip:
        assert pip.stdout is not None
        for line in pip.stdout:
            tail.append(line.rstrip())
            if line.startswith("Collecting "):
                count += 1
                if on_terminal:
                    print(f"\r  {count} packages", end="", file=sys.stderr, flush=True)
                elif count % 40 == 0:
                    print(f"  {count} packages", file=sys.stderr, flush=True)
            elif count and line.startswith("Installing collected"):
                end = "\n" if not on_terminal else ""
                start = "\r" if on_terminal else ""
                text = f"{start}  {count} packages collected, unpacking them"
                print(text, end=end, file=sys.stderr, flush=True)
    if on_terminal and count:
        print(file=sys.stderr)
    if pip.returncode:
        print(*(f"  pip: {line}" for line in tail), sep="\n", file=sys.stderr)
        raise SetupError("pip failed (above); the next start tries again")


def make_environment() -> None:
    """Make ``.venv`` from nothing and install the locked packages."""
    if any(importlib.util.find_spec(name) is None for name in ("venv", "ensurepip")):
        raise SetupError(
            "this Python has no venv module; on Debian and Ubuntu: sudo apt install python3-venv"
        )
    if VENV.is_symlink():
        VENV.unlink()
    elif VENV.exists():
        say("removing the old or unfinished .venv")
        shutil.rmtree(VENV)
    say(f"making .venv with Python {platform.python_version()}")
    made = subprocess.run(
        [sys.executable, "-m", "venv", str(VENV)],
        env={k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        check=False,
    )
    if made.returncode:
        last = (made.stdout.strip().splitlines() or ["no output"])[-1]
        raise SetupError(f"python -m venv failed: {last}")
    say("installing the packages of requirements.lock (once; a minute or two)")
    # The lock file is complete, so there are no dependencies left to resolve.
    run_pip(["--no-compile", "--no-deps", "--require-hashes", "-r", str(LOCK_FILE)])


def compile_what_runs() -> None:
    """Import every module once so that its byte code, and that of what it uses, is stored.

    Compiling all that pip installs takes four times as long; leaving it to the nodes, which start
    all at once, would do the same work many times over.
    """
    names = sorted(
        ".".join(path.relative_to(ROOT / "src").with_suffix("").parts[1:])
        for path in (ROOT / "src").glob("*/*/**/*.py")
    )
    names += ["numba", "rosidl_generator_py"]  # imported by the first kernel, and the first node
    code = (
        "import contextlib, importlib, sys\n"
        "for name in sys.argv[1:]:\n"
        "    with contextlib.suppress(Exception):\n"
        "        importlib.import_module(name)\n"
    )
    env = {k: v for k, v in clean_environment().items() if k != "PYTHONDONTWRITEBYTECODE"}
    command = [str(VENV / "bin" / "python"), "-c", code, *names]
    quiet = subprocess.DEVNULL
    subprocess.run(command, env=env, stdin=quiet, stdout=quiet, stderr=quiet, check=False)


def set_up() -> None:
    """Bring ``.venv`` to what the lock file and pyproject.toml ask for, if it is not there."""
    want = wanted_stamp()
    if read_stamp() == want:
        return
    with only_one_setup():
        have = read_stamp()
        if have == want:
            return
        if {**have, "project": ""} != {**want, "project": ""}:
            make_environment()
        STAMP.unlink(missing_ok=True)
        say("installing this project into .venv")
        run_pip(["--no-deps", "--no-build-isolation", "--no-index", "-e", str(ROOT)])
        compile_what_runs()
        write_stamp(want)
        say("ready")


def run_checks(pytest_arguments: list[str]) -> int:
    """Run what continuous integration runs, pytest and its summary last; return the exit code."""
    env = clean_environment()
    python = str(VENV / "bin" / "python")
    checks = {
        "ruff format": [str(VENV / "bin" / "ruff"), "format", "--check", "."],
        "ruff check": [str(VENV / "bin" / "ruff"), "check", "."],
        "imports": [str(VENV / "bin" / "lint-imports"), "--no-cache"],
        "mypy": [python, "-m", "mypy"],
        # Examples that are distributions of their own have settings of their own.
        **{
            f"mypy {path.parent.name}": [python, "-m", "mypy", "--config-file", str(path)]
            for path in sorted((ROOT / "examples").glob("*/pyproject.toml"))
        },
        "documents": [python, str(ROOT / "docs" / "refresh.py"), "--check"],
        # Faults put into copies of the sources, each of which a test must notice.
        "mutants": [python, str(ROOT / "tests" / "mutants.py")],
    }
    failed: list[str] = []
    if not pytest_arguments:
        for name, command in checks.items():
            print(f"== {name}", flush=True)
            if subprocess.run(command, cwd=ROOT, env=env, check=False).returncode:
                failed.append(name)
        # Tests marked `system` come in two groups, each on one worker (tests/conftest.py), and wait
        # for much of their time: a third worker has the rest.
        # A test that hangs below Python ends with its worker, and its stack is printed.
        limit = ["--timeout", "300", "--timeout-method", "thread"]
        pytest_arguments = ["-n", "3", "--dist", "loadgroup", *limit, "-q"]
    print("== pytest", flush=True)
    command = [python, "-m", "pytest", *pytest_arguments]
    code = subprocess.run(command, cwd=ROOT, env=env, check=False).returncode
    if failed:
        say(f"failed: {', '.join(failed)}")
    return code or (1 if failed else 0)


def main(arguments: list[str]) -> int:
    """Set up where needed, then run the tests or become ``rail``."""
    try:
        set_up()
    except SetupError as error:
        say(str(error))
        return 2
    except OSError as error:
        say(f"cannot set up: {error}")
        return 2
    except KeyboardInterrupt:
        say("interrupted; the next start takes up the set-up again")
        return 130
    if arguments[:1] == ["test"]:
        try:
            return run_checks(arguments[1:])
        except KeyboardInterrupt:
            return 130
    rail = VENV / "bin" / "rail"
    sys.stdout.flush()
    sys.stderr.flush()
    os.execve(rail, [str(rail), *(arguments or ["run", "demo"])], clean_environment())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
