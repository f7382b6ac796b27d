"""Serve a loopback ANAFI and fly it by its protocol, without Parrot's SDK; print its events."""

import json
import re
import socket
import struct
import subprocess
import sys

# All settings, all states, take off, move forward by 0.5 m, land, and the event that ends each.
COMMANDS = "00020000", "00040000", "01000100", f"010007000000003f{'0' * 24}", "01000300"
ENDS = "0.3.0", "0.5.0", "1.4.1 2", "1.34.0 0", "1.4.1 0"


def fly(discovery: int) -> list[str]:
    """Send each command after the end of the one before; return the names of events."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind(("127.0.0.1", 0))
    link.settimeout(60)
    keep = socket.create_connection(("127.0.0.1", discovery))  # closed, the client is gone
    control = socket.create_connection(("127.0.0.1", json.loads(keep.recv(4096)[:-1])["port"]))
    control.sendall(json.dumps({"d2c_port": link.getsockname()[1], "proto_v_max": 2}).encode())
    drone = "127.0.0.1", json.loads(control.recv(4096)[:-1])["c2d_port"]
    events: set[str] = set()
    for number, (command, end) in enumerate(zip(map(bytes.fromhex, COMMANDS), ENDS, strict=True)):
        size = len(command)
        link.sendto(struct.pack("<BBBHBH", 12, 4, 11, number, size + 2, size) + command, drone)
        while end not in events:
            rest = link.recv(65536)
            while len(rest) > 6:
                _, kind, buffer, sequence, size, more = struct.unpack_from("<BBBHBB", rest)
                start, size = (7, size - 128 + 128 * more) if size > 127 else (6, size)
                payload, rest = rest[start : start + size], rest[start + size :]
                if buffer == 0:  # a ping
                    link.sendto(struct.pack("<BBBHB", 12, 2, 1, sequence, size) + payload, drone)
                if kind == 4:  # to be acknowledged
                    link.sendto(struct.pack("<BBBHBH", 12, 1, buffer + 128, 0, 2, sequence), drone)
                while buffer == 126 and payload:
                    stop = 2 + int.from_bytes(payload[:2], "little")
                    name = "{}.{}.{}".format(*struct.unpack_from("<BBH", payload, 2))
                    events |= {name} if number < 2 else {end} & {f"{name} {payload[stop - 4]}"}
                    payload = payload[stop:]
    return sorted(events)


words = [sys.executable, "-m", "uav_bt", *sys.argv[1:]]
with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server:  # noqa: S603
    try:
        print(json.dumps(fly(int(re.findall(r"discovery (\d+)", next(server.stdout))[0]))))
    finally:
        server.terminate()
