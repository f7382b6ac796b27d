"""The loopback ANAFI's video: RTSP and RTP, H.264, and the telemetry of every frame.

Names are imported when they are first used: PyAV is loaded only where video is served.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from sim_bridge.loopback.video.encoder import EncoderConfig
    from sim_bridge.loopback.video.frame import (
        FrameSource,
        GeoPosition,
        NorthEastDown,
        VideoFrame,
    )
    from sim_bridge.loopback.video.sdp import StreamIdentity
    from sim_bridge.loopback.video.server import VideoServer, serve_video
    from sim_bridge.loopback.video.streamer import VideoStats

__all__ = [
    "EncoderConfig",
    "FrameSource",
    "GeoPosition",
    "NorthEastDown",
    "StreamIdentity",
    "VideoFrame",
    "VideoServer",
    "VideoStats",
    "serve_video",
]

_HOMES: Final = {
    "EncoderConfig": "sim_bridge.loopback.video.encoder",
    "FrameSource": "sim_bridge.loopback.video.frame",
    "GeoPosition": "sim_bridge.loopback.video.frame",
    "NorthEastDown": "sim_bridge.loopback.video.frame",
    "StreamIdentity": "sim_bridge.loopback.video.sdp",
    "VideoFrame": "sim_bridge.loopback.video.frame",
    "VideoServer": "sim_bridge.loopback.video.server",
    "VideoStats": "sim_bridge.loopback.video.streamer",
    "serve_video": "sim_bridge.loopback.video.server",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)
