"""Time the loopback ANAFI's video: rate, latency and CPU, from a frame to a client's decoder.

    python benchmarks/loopback_video.py

A moving pattern replaces the twin's camera, so that drawing is not in the times. The server runs
in a separate process; a client plays over UDP and decodes with PyAV. The latency is that of the
pixels: every frame shows the time of its capture as black and white blocks, which the client
reads from the decoded frame.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import multiprocessing
import os
import re
import socket
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection

import av
import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.video.encoder import EncoderConfig
from sim_bridge.loopback.video.frame import VideoFrame
from sim_bridge.loopback.video.server import serve_video
from sim_bridge.loopback.video.streamer import VideoStats

SIZES = ((640, 360), (1280, 720))
BLOCK_PX = 16  # a macroblock, so that blocks do not disturb each other
BITS = 32  # of microseconds: more than an hour
PATIENCE_S = 60.0
START_CODE = b"\x00\x00\x00\x01"
WARM_UP = 60  # frames that are not counted: a client that starts has some waiting


class Pattern:
    """Coarse noise that runs to and fro, with the time on it."""

    def __init__(self, size_px: tuple[int, int]) -> None:
        width, height = size_px
        random = np.random.default_rng(0)
        coarse = random.integers(256, size=(height // 8, width // 8, 3), dtype=np.uint8)
        image = coarse.repeat(8, axis=0).repeat(8, axis=1)
        self._images = itertools.cycle(
            [np.roll(image, abs(2 * step), 1) for step in range(-16, 16)]
        )

    def newest(self) -> VideoFrame:
        """Return the pattern, a step further on."""
        image = next(self._images).copy()
        now_s = time.monotonic()
        bits = round(1e6 * now_s) >> np.arange(BITS) & 1
        blocks = (255 * bits).astype(np.uint8).repeat(BLOCK_PX)
        image[:BLOCK_PX, : len(blocks)] = blocks[None, :, None]
        return VideoFrame(image=image, captured_s=now_s)


def age_s(luma: NDArray[np.uint8]) -> float:
    """Return how long ago the frame was captured that a decoder just gave."""
    middle = BLOCK_PX // 2
    bits = luma[middle, middle : BITS * BLOCK_PX : BLOCK_PX] > 128
    captured_us = int((bits.astype(np.int64) << np.arange(BITS)).sum())
    return 1e-6 * ((round(1e6 * time.monotonic()) - captured_us) % (1 << BITS))


def _serve(config: EncoderConfig, link: Connection) -> None:
    """Serve until asked to stop, then send the work done and the CPU time per frame."""

    async def work() -> tuple[VideoStats, float]:
        server = await serve_video(Pattern(config.size_px), port=0, encoder=config)
        link.send(server.url)
        await asyncio.to_thread(link.recv)
        began, cpu_s = server.stats().frames_encoded, time.process_time()
        await asyncio.to_thread(link.recv)
        stats = server.stats()
        cost_s = (time.process_time() - cpu_s) / (stats.frames_encoded - began)
        await server.close()
        return stats, cost_s

    link.send(asyncio.run(work()))


class Client:
    """Asks for the video and receives it by datagrams; no more of RTSP and RTP than that takes."""

    def __init__(self, url: str) -> None:
        host, _, port = url.removeprefix("rtsp://").removesuffix("/live").rpartition(":")
        self._url = url
        self._control = socket.create_connection((host, int(port)), timeout=PATIENCE_S)
        self._data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._data.settimeout(PATIENCE_S)
        self._data.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._data.bind((host, 0))
        at = self._data.getsockname()[1]
        answer = self._ask("SETUP", f"Transport: RTP/AVP;unicast;client_port={at}-{at + 1}")
        session = re.search(r"Session: (\w+)", answer)
        if session is None:
            raise SystemExit(f"expected a session, got {answer}")
        self._ask("PLAY", f"Session: {session[1]}")

    def _ask(self, method: str, header: str) -> str:
        request = f"{method} {self._url} RTSP/1.0\r\nCSeq: 1\r\n{header}\r\n\r\n"
        self._control.sendall(request.encode())
        return self._control.recv(4096).decode()

    def ages_s(self) -> Iterator[float]:
        """Yield the age of every frame as it is decoded."""
        decoder = av.CodecContext.create("h264", "r")
        decoder.thread_count = 1  # with frames on several threads they come later
        decoder.options = {"flags": "low_delay"}
        stream = b""
        while True:
            packet = self._data.recv(2048)
            stream += annex_b(packet)
            if packet[1] & 0x80:  # the frame's last
                for frame in decoder.decode(av.Packet(stream)):
                    yield age_s(np.asarray(frame.to_ndarray(format="yuv420p"), np.uint8))
                stream = b""


def annex_b(packet: bytes) -> bytes:
    """Return what an RTP packet carries as H.264 with start codes (RFC 6184)."""
    extended = 4 + 4 * int.from_bytes(packet[14:16], "big") if packet[0] & 0x10 else 0
    payload = packet[12 + extended :]
    kind = payload[0] & 0x1F
    if kind == 28:
        first = bytes([payload[0] & 0xE0 | payload[1] & 0x1F])
        return (START_CODE + first if payload[1] & 0x80 else b"") + payload[2:]
    if kind != 24:
        return START_CODE + payload
    units, at = b"", 1
    while at < len(payload):
        size = int.from_bytes(payload[at : at + 2], "big")
        units += START_CODE + payload[at + 2 : at + 2 + size]
        at += 2 + size
    return units


def _measure(config: EncoderConfig, frames: int) -> str:
    """Return a row: what one size and rate cost."""
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(target=_serve, args=(config, there), daemon=True)
    process.start()
    ages: list[float] = []
    for age in Client(here.recv()).ages_s():
        ages.append(age)
        if len(ages) == WARM_UP:
            here.send("count from here")
        if len(ages) == WARM_UP + frames:
            break
    here.send("stop")
    stats, cost_s = here.recv()
    process.join()
    p50_ms, p95_ms, max_ms = 1e3 * np.percentile(ages[WARM_UP:], (50, 95, 100))
    width, height = config.size_px
    return (
        f"{width:5d}x{height:<4d} {config.rate_hz:6.0f} {stats.rate_hz:9.1f} {p50_ms:8.1f} "
        f"{p95_ms:8.1f} {max_ms:8.1f} {stats.encode_ms[0]:9.1f} {1e3 * cost_s:12.1f}"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=300, help="counted for each row")
    parser.add_argument("--rate", type=float, nargs="+", default=[30.0], help="wanted, Hz")
    options = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    print("                wanted   reached  latency of the pixels, ms   encoding   CPU of a")
    print("      size          Hz        Hz      p50      p95      max        ms  frame, ms")
    for size_px in SIZES:
        for rate_hz in options.rate:
            config = EncoderConfig(size_px=size_px, rate_hz=rate_hz)
            print(_measure(config, options.frames))


if __name__ == "__main__":
    main()
