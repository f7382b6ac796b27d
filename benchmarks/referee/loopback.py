"""A client of the loopback ANAFI, without Parrot's SDK."""

import json
import socket
import struct
from typing import Any


def fly(host: str, discovery: int, script: list[dict[str, Any]]) -> list[str]:
    """Send commands, each after the event that ends the one before; return the events."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.bind((host, 0))
    link.settimeout(60)
    keep = socket.create_connection((host, discovery))  # the drone is gone when this closes
    card = json.loads(keep.recv(4096).rstrip(b"\0"))
    request = {"d2c_port": link.getsockname()[1], "device_id": card["serial"], "proto_v_max": 2}
    with socket.create_connection((host, card["port"])) as control:
        control.sendall(json.dumps(request).encode() + b"\0")
        drone = host, json.loads(control.recv(4096).rstrip(b"\0"))["c2d_port"]
    came, last = [], -1
    for number, step in enumerate(script):
        data = struct.pack(f"<BBH{len(step['values'])}f", *step["command"], *step["values"])
        frame = struct.pack("<BBBHBH", 12, 4, 11, number, len(data) + 2, len(data))
        link.sendto(frame + data, drone)
        begun = len(came)
        while step["end"] not in came[begun:]:
            rest = link.recv(65536)
            while len(rest) > 6:
                _, kind, buffer, sequence, size, more = struct.unpack_from("<BBBHBB", rest)
                start, size = (7, size - 128 + 128 * more) if size > 127 else (6, size)
                events, rest = rest[start : start + size], rest[start + size :]
                if buffer == 0:  # a ping
                    link.sendto(struct.pack("<BBBHB", 12, 2, 1, sequence, size) + events, drone)
                if kind == 4:  # to be acknowledged
                    ack = struct.pack("<BBBHBH", 12, 1, buffer + 128, 0, 2, sequence)
                    link.sendto(ack, drone)
                while buffer == 126 and events and sequence != last:
                    stop = 2 + int.from_bytes(events[:2], "little")
                    name = "{}.{}.{}".format(*struct.unpack_from("<BBH", events, 2))
                    name += f" {events[stop - 4]}" if name in step["states"] else ""
                    came += [name] if name == step["end"] or step["all"] else []
                    events = events[stop:]
                last = sequence if buffer == 126 else last
    return came
