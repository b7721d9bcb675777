"""One corridor on two hosts: wayside on the one, trains on the other; the digest stays the same.

Run:  sudo -E env "PATH=$PATH" python examples/two_hosts.py [SCENARIO] [SECONDS]
See:  both digests. The hosts are two network namespaces joined by a cable (a veth pair), each
      with shared memory of its own; on real hosts run the same two `rail run --only` commands.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

HOSTS = (f"rail{os.getpid()}w", f"rail{os.getpid()}o")
OWN_MEMORY = ("unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /dev/shm && exec "$@"', "-")


def ip(*arguments: str) -> None:
    """Run an `ip` command."""
    subprocess.run(["ip", *arguments], check=True, capture_output=True)


def make_hosts() -> None:
    """Make two namespaces, a cable between them, and addresses on it."""
    for host in HOSTS:
        ip("netns", "add", host)
        ip("-n", host, "link", "set", "lo", "up", "multicast", "on")
    cable = ("cable", "type", "veth", "peer", "name", "cable", "netns", HOSTS[1])
    ip("-n", HOSTS[0], "link", "add", *cable)
    for number, host in enumerate(HOSTS, start=1):
        ip("-n", host, "addr", "add", f"192.0.2.{number}/24", "dev", "cable")
        ip("-n", host, "link", "set", "cable", "up", "multicast", "on")
        ip("-n", host, "route", "add", "224.0.0.0/4", "dev", "cable")


def main(scenario: str = "branch", seconds: str = "10") -> int:
    """Run the scenario on two hosts, then on one, and compare."""
    run = [sys.executable, "-m", "rail_corridor.cli.main", "run", scenario, "--duration", seconds]
    wide = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    with tempfile.TemporaryDirectory() as directory:
        reports = [Path(directory, name) for name in ("two.json", "one.json")]
        try:
            make_hosts()
            parts = [["--only", "onboard"], ["--only", "wayside", "--report", str(reports[0])]]
            hosts = [
                subprocess.Popen(["ip", "netns", "exec", host, *OWN_MEMORY, *run, *part], env=wide)
                for host, part in zip(reversed(HOSTS), parts, strict=True)
            ]
            codes = [host.wait() for host in hosts]
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"no network namespaces can be made here: {error}")
            return 0
        finally:
            for host in HOSTS:
                subprocess.run(["ip", "netns", "del", host], capture_output=True)
        codes.append(subprocess.run([*run, "--report", str(reports[1])]).returncode)
        digests = [json.loads(path.read_text())["digest"] for path in reports]
    print(f"two hosts: {digests[0]}\none host:  {digests[1]}")
    return max(codes) or int(digests[0] != digests[1])


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
