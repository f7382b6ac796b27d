"""Flies the loopback ANAFI with unmodified Olympe scripts, one process each.

Run from the repository, with the Python of an environment that has Olympe::

    python benchmarks/loopback_clients.py --python /path/to/venv/bin/python

The scripts are those of ``benchmarks/olympe_clients``, and with ``--examples`` those that Olympe's
wheel brings (7.7.5 also wants pysdl2, pysdl2-dll and PyOpenGL for them, 8.5.0 Pillow). They find
the drone at its own ports, so that 80 and 554 must be free and allowed (root); elsewhere
``--http-port 8080 --rtsp-port 8554`` serves all but the media list.
"""

from __future__ import annotations

import argparse
import asyncio
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

from olympe_scripts import FaultError, run, served

SCRIPTS = Path(__file__).parent / "olympe_clients"
BEHIND_REMOTE = "skycontroller"  # the script that meets a remote control
# Olympe's own, by the folder in which its releases keep them; those of other drones (the ANAFI Ai's
# camera2 and logsync among them), of their media and with windows are left out.
_BOTH = (
    *("takeoff", "takeoff_if_necessary_1", "takeoff_if_necessary_2", "moveby", "moveby2"),
    *("maxtilt", "maxtiltget", "enums", "bitfields", "subscriber", "physical_drone"),
    "piloting_hud",
)
EXAMPLES = {
    "doc/examples": (*_BOTH, "asyncaction", "streaming", "pdraw"),  # 7.7
    "examples": (
        *(*_BOTH, "maxtilt_get", "maxtilt_set", "moveby_edit"),
        *("streaming_single", "streaming_multiple", "streaming_process_frames"),
    ),  # 8.5
}


def examples_of(python: str) -> list[Path]:
    """Return the chosen examples of the Olympe that a Python has."""
    code = "import importlib.util as u; print(u.find_spec('olympe').submodule_search_locations[0])"
    found = subprocess.run([python, "-c", code], check=True, capture_output=True, text=True)  # noqa: S603 - the Python that was asked for
    home = Path(found.stdout.strip())
    paths = [home / folder / f"{name}.py" for folder, names in EXAMPLES.items() for name in names]
    return [path for path in paths if path.is_file()]


async def fly(python: str, script: Path, address: str, ports: list[str], rtsp: int | None) -> bool:
    """Run one script against a separate drone; print a line about it."""
    if script.stem == BEHIND_REMOTE:
        ports = [*ports, "--skycontroller"]
    env = {} if rtsp is None else {"DRONE_RTSP_PORT": str(rtsp)}
    start, good, note = time.monotonic(), True, ""
    # A separate folder: scripts write files, and must not import each other by accident.
    with tempfile.TemporaryDirectory() as folder:
        try:
            async with served(address, *ports):
                note = await run(python, Path(shutil.copy(script, folder)), address, **env)
        except FaultError as error:
            good, note = False, str(error)
    took_s, verdict = time.monotonic() - start, "ok" if good else "FAILED"
    print(f"{script.stem:<26}{verdict:<8}{took_s:>6.1f} s  {note}", flush=True)
    return good


async def fly_all(options: argparse.Namespace, scripts: list[Path], ports: list[str]) -> list[bool]:
    """Run the scripts one after the other."""
    rtsp = options.rtsp_port
    return [await fly(options.python, one, options.address, ports, rtsp) for one in scripts]


def main() -> None:
    """Run the scripts; exit with 1 when one failed."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--python", required=True, help="of an environment with Olympe")
    parser.add_argument("--script", action="append", help="only this one; repeatable")
    parser.add_argument("--examples", action="store_true", help="Olympe's own examples, too")
    parser.add_argument("--address", default="127.0.0.1")
    parser.add_argument("--http-port", type=int)
    parser.add_argument("--rtsp-port", type=int)
    options = parser.parse_args()
    scripts = sorted(SCRIPTS.glob("*.py"))
    if options.examples:
        scripts += examples_of(options.python)
    if options.script:
        scripts = [path for path in scripts if path.stem in options.script]
    ports = []
    for name in ("http_port", "rtsp_port"):
        port = getattr(options, name)
        ports += [] if port is None else [f"--{name.replace('_', '-')}", str(port)]
    results = asyncio.run(fly_all(options, scripts, ports))
    print(f"{sum(results)} of {len(results)} flew")
    raise SystemExit(0 if all(results) else 1)


if __name__ == "__main__":
    main()
