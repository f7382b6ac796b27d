"""Serve a loopback ANAFI and fly it by its protocol, without Parrot's SDK; print its events."""

import json
import re
import socket
import struct
import subprocess
import sys

# Commands with their arguments, and the event that ends each.
SCRIPT = (
    ("00020000", "0.3.0"),  # all settings
    ("00040000", "0.5.0"),  # all states
    ("01000100", "1.4.1 2"),  # take off, hovering
    ("01000700" + struct.pack("<4f", 0.5, 0, 0, 0).hex(), "1.34.0 0"),  # move by 0.5 m
    ("01000300", "1.4.1 0"),  # land, landed
)


def fly(discovery: int) -> list[str]:
    """Send each command after the end of the one before; return the names of events."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind(("127.0.0.1", 0))
    link.settimeout(60)
    keep = socket.create_connection(("127.0.0.1", discovery))  # closed, the client is gone
    with socket.create_connection(("127.0.0.1", json.loads(keep.recv(4096)[:-1])["port"])) as link_:
        link_.sendall(json.dumps({"d2c_port": link.getsockname()[1], "proto_v_max": 2}).encode())
        drone = "127.0.0.1", json.loads(link_.recv(4096)[:-1])["c2d_port"]

    def send(kind: int, buffer: int, sequence: int, payload: bytes) -> None:
        head = struct.pack("<BBBHB", 12, kind, buffer, sequence, len(payload))
        link.sendto(head + payload, drone)

    events: set[str] = set()
    for number, (command, end) in enumerate(SCRIPT):
        send(4, 11, number, struct.pack("<H", len(command) // 2) + bytes.fromhex(command))
        while end not in events:
            rest = link.recv(65536)
            while len(rest) > 6:
                _, kind, buffer, sequence, size, more = struct.unpack_from("<BBBHBB", rest)
                start, size = (7, size - 128 + 128 * more) if size > 127 else (6, size)
                payload, rest = rest[start : start + size], rest[start + size :]
                if buffer == 0:  # a ping
                    send(2, 1, sequence, payload)
                if kind == 4:  # to be acknowledged
                    send(1, buffer + 128, 0, struct.pack("<H", sequence))
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
