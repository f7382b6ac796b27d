"""Adapter of Parrot's SDK: the only module that imports it and handles its versions.

Differences between parrot-olympe 7.7.5 and 8.5.0:

- The port of the web interface is `media_port` in 7.7.5 and `http_port` in 8.5.0. Only 8.5.0 lets
  the user choose the discovery port.
- The callback for decoded frames is set by `set_callbacks` before `play` in 7.7.5, and with a
  stream in 8.5.0.
- `play` uses the drone's first medium in 7.7.5. In 8.5.0 it requires the name that direct Wi-Fi has
  and a remote control has not; `play_multiple_stream` still uses the first medium.
- The expectation of `subscribe` is optional in 7.7.5 and required in 8.5.0.
- `connect` takes at most 6 s in 7.7.5, and at least 45 s in 8.5.0.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import importlib
import logging
import sys
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any, Final

from sim_bridge.olympe.config import DISCOVERY_PORT, RTSP_PORT, OlympeConfig
from uav_bt.errors import InputError, MissingDependencyError

VIDEO_LIMIT_S: Final = 5.0  # of the request for the video; that of the SDK
_NEW_API: Final = (8,)  # first version of the second kind
_DRONE_BEHIND: Final = 100  # a SkyController 3 has the drone's port 80 at 180
_LOGGERS: Final = ("olympe", "ulog", "concurrent.futures")  # the SDK adds handlers to them
_LEVELS: Final = {logging.CRITICAL: logging.WARNING, logging.ERROR: logging.INFO}


@dataclass(frozen=True, kw_only=True)
class Sdk:
    """The parts of the SDK that this project uses; `remote` is whether a SkyController answers."""

    version: tuple[int, ...]
    classes: Any  # has Drone and SkyController3
    message: Callable[[str], Any]  # class of a command or an event by its full name
    # Version 8 or later: makes a stream of the first medium from the callback for its frames.
    stream: Callable[[Callable[[Any], None]], Any]

    def drone(self, config: OlympeConfig, *, remote: bool) -> Any:
        """Return a new SDK object for a drone; a reused one sometimes fails to connect."""
        kind = self.classes.SkyController3 if remote else self.classes.Drone
        host, port = config.host, config.discovery_port
        if self.version >= _NEW_API:
            return kind(host, http_port=config.http_port, discovery_port=port)
        if port != DISCOVERY_PORT:
            raise InputError(
                f"parrot-olympe {'.'.join(map(str, self.version))} always discovers on port "
                f"{DISCOVERY_PORT}, asked for {port}: give each drone another address "
                "(127.0.0.2, ...) or install parrot-olympe 8"
            )
        return kind(host, media_port=config.http_port, media_autoconnect=False)

    def web_address(self, drone: Any, config: OlympeConfig, *, remote: bool) -> tuple[str, int]:
        """Return host and port of the web server of a connected drone.

        Behind a remote control it is the proxy of version 8.5.0. Version 7.7.5 shows no proxy; the
        address is then that of its library, 100 ports above the drone's.
        """
        if not remote:
            return config.host, config.http_port
        proxy = getattr(drone, "http_proxy", None)
        if proxy is not None and proxy.address and proxy.port:
            return str(proxy.address), int(proxy.port)
        return config.host, config.http_port + _DRONE_BEHIND

    def play(
        self, drone: Any, config: OlympeConfig, on_frame: Callable[[Any], None], *, remote: bool
    ) -> bool:
        """Start the video; return whether the drone accepted in time.

        Frames come on a thread of the SDK. Each is valid only during the call.
        """
        shared = remote and config.rtsp_port == RTSP_PORT
        asked: dict[str, Any] = {"port": None if shared else config.rtsp_port}
        asked["timeout"] = VIDEO_LIMIT_S
        streaming = drone.streaming
        try:
            if self.version >= _NEW_API:
                streams = [self.stream(on_frame)]
                return bool(streaming.play_multiple_stream(streams_list=streams, **asked))
            streaming.set_callbacks(raw_cb=on_frame)
            return bool(streaming.play(**asked))
        except (TimeoutError, concurrent.futures.CancelledError, asyncio.CancelledError):
            return False  # the SDK's answer if the drone refused


def load_sdk() -> Sdk:
    """Import the SDK and redirect its log messages.

    Raises:
        MissingDependencyError: the SDK is not installed, or does not run with this Python.
    """
    disabled = logging.root.manager.disable
    # The SDK logs during its import, before its handlers can be replaced.
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # warnings of its dependencies, at every start
            _do_without_glx()
            olympe = importlib.import_module("olympe")
        version = tuple(int(part) for part in str(olympe.__version__).split(".")[:3])
    except Exception as error:
        python = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise MissingDependencyError(
            f"Parrot's SDK cannot be imported with Python {python} "
            f"({type(error).__name__}: {error}); it runs with Python 3.10 to 3.12 on Linux x86-64: "
            "docs/real-drone.md lists the commands that install it in a separate environment"
        ) from error
    finally:
        logging.disable(disabled)
    for name in _LOGGERS:
        logger = logging.getLogger(name)
        logger.handlers = [_Redirect()]
        logger.propagate = False
    return Sdk(version=version, classes=olympe, message=_message, stream=_stream)


def _do_without_glx() -> None:
    """Let the SDK be imported when PyOpenGL already draws without a window, as in the twin.

    PyOpenGL then has no GLX. The SDK imports it for a viewer that is never opened.
    """
    try:
        importlib.import_module("OpenGL.GLX")
    except AttributeError:
        sys.modules["OpenGL.GLX"] = ModuleType("OpenGL.GLX")


def _message(name: str) -> Any:
    module, _, message = name.rpartition(".")
    return getattr(importlib.import_module(f"olympe.messages.{module}"), message)


def _stream(on_frame: Callable[[Any], None]) -> Any:
    pdraw = importlib.import_module("olympe.features.video.pdraw")
    raw = importlib.import_module("olympe_deps").VDEF_FRAME_TYPE_RAW
    callbacks = pdraw.Callbacks(media_type=(raw, None), video_frame=on_frame)
    return pdraw.StreamInfoDefault(callbacks=[callbacks])


class _Redirect(logging.Handler):
    """Logs the SDK's records at a lower level, because its errors are often harmless."""

    def emit(self, record: logging.LogRecord) -> None:
        logging.getLogger(f"{__name__}.{record.name}").log(
            _LEVELS.get(record.levelno, logging.DEBUG), "%s", record.getMessage()
        )
