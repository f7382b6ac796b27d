"""Unmodified programs of Parrot's SDK fly the loopback ANAFI; they need its ports, 80 and 554.

Without the SDK they are skipped. `.ci/nightly` runs them in an environment of its own.
"""

from __future__ import annotations

import asyncio
import importlib.util
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.sim_bridge.lossy_proxy import lossy

ROOT = Path(__file__).parents[2]
CLIENTS = ROOT / "benchmarks" / "olympe_clients"
LEFT = ROOT / "benchmarks" / "olympe_faults" / "left.py"
PATIENCE_S = 240.0
OLYMPE = importlib.util.find_spec("olympe")
# Examples that Parrot's wheel brings, without those of other drones, of recordings, and with
# windows, and without `maxtilt_get`: the SDK may crash if it disconnects as soon as it connected.
EXAMPLES = (
    *("takeoff", "takeoff_if_necessary_1", "takeoff_if_necessary_2", "moveby", "moveby2"),
    *("moveby_edit", "maxtilt", "maxtilt_set", "maxtiltget", "enums", "bitfields"),
    *("subscriber", "physical_drone", "piloting_hud", "streaming", "pdraw"),
    *("streaming_single", "streaming_multiple", "streaming_process_frames"),
)

pytestmark = [
    pytest.mark.skipif(OLYMPE is None, reason="Olympe is absent"),
    pytest.mark.skipif(os.geteuid() != 0, reason="the ports 80 and 554 take root"),
]


def programs() -> list[Path]:
    """Return our programs, and the examples that the installed release has."""
    home = Path("absent") if OLYMPE is None or OLYMPE.origin is None else Path(OLYMPE.origin).parent
    folders = home / "examples", home / "doc" / "examples"  # of 8.5 and of 7.7
    found = [folder / f"{name}.py" for folder in folders for name in EXAMPLES]
    return [*sorted(CLIENTS.glob("*.py")), *(path for path in found if path.is_file())]


@contextmanager
def served(address: str, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Run a loopback ANAFI, which must live to the end unless it was killed."""
    command = [sys.executable, "-m", "uav_bt", "serve-anafi", "--address", address, *options]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as server:  # noqa: S603
        try:
            assert server.stdout is not None
            assert server.stdout.readline().startswith("'ANAFI")
            yield server
            assert server.poll() in (None, -signal.SIGKILL)
        finally:
            server.send_signal(signal.SIGINT)


def start(
    script: Path, address: str, *arguments: str, folder: Path | None = None
) -> subprocess.Popen[str]:
    """Start a program in a folder; it imports nothing from its own (-P)."""
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-P", str(script), *arguments],
        env=os.environ | {"DRONE_IP": address},
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def finish(program: subprocess.Popen[str], entered: str = "") -> str:
    output, _ = program.communicate(entered, timeout=PATIENCE_S)
    assert program.returncode == 0, output[output.rfind("Traceback") :]
    return output


def prints(program: subprocess.Popen[str], line: str) -> None:
    """Wait for a line between those of the SDK's log."""
    assert program.stdout is not None
    patience = threading.Timer(PATIENCE_S, program.kill)
    patience.start()
    printed = any(found.strip() == line for found in program.stdout)
    patience.cancel()
    assert printed


@pytest.mark.parametrize("script", programs(), ids=lambda script: script.stem)
def test_a_program_flies(script: Path, tmp_path: Path) -> None:
    options = ["--skycontroller"] if script.stem == "skycontroller" else []
    with served("127.0.5.1", *options):
        finish(start(script, "127.0.5.1", folder=tmp_path))


def test_three_drones_fly_at_once() -> None:
    first, second, third = addresses = [f"127.0.5.{number}" for number in (2, 3, 4)]
    with served(first), served(second), served(third), ThreadPoolExecutor() as pool:
        list(pool.map(lambda address: finish(start(CLIENTS / "move_by.py", address)), addresses))


def test_a_drone_whose_program_dies_hovers_and_the_next_program_lands_it() -> None:
    with served("127.0.5.5"):
        program = start(LEFT, "127.0.5.5", "flies")
        prints(program, "flying")
        program.kill()
        program.communicate()
        finish(start(LEFT, "127.0.5.5", "lands"))


def test_a_program_whose_drone_dies_finds_the_next_one() -> None:
    program = start(LEFT, "127.0.5.6", "waits")
    assert program.stdin is not None
    with served("127.0.5.6") as server:
        prints(program, "flying")
        server.kill()
    program.stdin.write("\n")
    program.stdin.flush()
    prints(program, "left")
    with served("127.0.5.6"):
        finish(program, "\n")


@pytest.mark.parametrize(
    "script",
    ["settings", "move_by", "piloting"],
)
def test_a_network_that_loses_doubles_and_delays_loses_no_order(script: str) -> None:
    async def fly() -> None:
        async with lossy("127.0.5.8", "127.0.5.7", seed=0):
            await asyncio.to_thread(finish, start(CLIENTS / f"{script}.py", "127.0.5.8"))

    with served("127.0.5.7"):
        asyncio.run(fly())
