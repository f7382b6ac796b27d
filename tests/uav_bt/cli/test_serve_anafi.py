"""`uav-bt serve-anafi`."""

from __future__ import annotations

import socket

from tests.worlds.cli import assert_refused, run


def test_a_taken_port_exits_with_2_and_says_what_to_do() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        free = [f"--{name}-port=0" for name in ("discovery", "commands", "http", "rtsp")]
        result = run("serve-anafi", "--no-video", *free, "--control-port", port)
    assert_refused(result, f"the control port {port} of 127.0.0.1 is taken", "choose another port")
