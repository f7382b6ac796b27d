"""Nothing leaves the machine: no library reports its use or writes into the home folder.

Each program runs in a new process: a report is sent when a library is imported.
"""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.worlds.processes import ROOT, python

# With these variables libraries assume a test machine, where they never report.
TEST_MACHINES = ("CI", "TF_BUILD", "JENKINS_URL", "PYTEST_CURRENT_TEST", "ORT_DISABLE_TELEMETRY")

PERCEIVE = """
from uav_bt.cli.root import uav_bt
uav_bt(["net", "perceive", "views", "--model", "contact"])
"""
FLY = """
from uav_bt.app import FlightOptions, fly
fly(
    '<root BTCPP_format="4"><BehaviorTree ID="Look">'
    '<ReactiveSequence><Segment/><Sleep msec="300"/></ReactiveSequence>'
    '</BehaviorTree></root>',
    FlightOptions(image_size_px=(320, 180)),
)
"""
EXPORT = """
from pathlib import Path
import numpy as np
from perception.segmentation.training.unet import UNET_FILES, UNet, UNetConfig
net = UNet(UNetConfig(width_px=64, height_px=32, channels=(8, 16), outputs=1), ["box"])
UNET_FILES.save(Path("w.safetensors"), net, notes={})
UNET_FILES.export(Path("w.safetensors"), Path("net.onnx"),
                  calibration=[np.zeros((32, 64, 3), np.uint8)])
"""
VIEW = """
import time
from uav_bt.display.rerun import sinks
with sinks.shown(web=True, instead=""):
    time.sleep(2.0)
"""


@contextmanager
def proxy() -> Iterator[tuple[str, list[str]]]:
    """Serve as the proxy of a process; yield its address and the first lines of its requests."""
    asked: list[str] = []

    def listen() -> None:
        with suppress(OSError):  # the listener is closed at the end
            while True:
                client, _ = listener.accept()
                with client:
                    client.settimeout(2.0)
                    asked.append(client.recv(200).decode("latin-1").partition("\r\n")[0])

    with socket.create_server(("127.0.0.1", 0)) as listener:
        threading.Thread(target=listen, daemon=True).start()
        yield f"http://127.0.0.1:{listener.getsockname()[1]}", asked
        listener.shutdown(socket.SHUT_RDWR)


@pytest.mark.parametrize(
    "program", [PERCEIVE, FLY, EXPORT, VIEW], ids=["perceive", "fly", "export", "view"]
)
def test_nobody_is_called_and_the_home_folder_keeps_our_caches_only(
    program: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, work = tmp_path / "home", tmp_path / "work"
    for folder in (home, work / "views"):
        folder.mkdir(parents=True)
    cv2.imwrite(str(work / "views" / "1.png"), np.full((90, 160, 3), 120, np.uint8))
    for name in TEST_MACHINES:
        monkeypatch.delenv(name, raising=False)
    with proxy() as (address, asked):
        done = python(
            *("-c", program),
            folder=work,
            timeout=120,
            environment={
                "HOME": str(home),
                "XDG_CACHE_HOME": str(home / ".cache"),
                "XDG_CONFIG_HOME": str(home / ".config"),
                "XDG_DATA_HOME": str(home / ".local/share"),
                "MESA_SHADER_CACHE_DISABLE": "true",  # the driver's cache is not a report
                "https_proxy": address,
                "HTTPS_PROXY": address,
                "PYTHONPATH": str(ROOT),
            },
        )
    assert done.returncode == 0, done.stderr
    assert asked == []
    written = [path.relative_to(home).parts for path in home.rglob("*") if path.is_file()]
    assert {parts[:2] for parts in written} <= {(".cache", "uav-bt")}
