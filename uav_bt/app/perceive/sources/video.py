"""A video file, picture by picture."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import av

from uav_bt.app.perceive.sources.picture import Picture, Pictures
from uav_bt.errors import FileError

__all__ = ["VideoSource"]

_UNKNOWN_RATE: Final = 25.0  # of a video file that does not say


class VideoSource:
    """A video file, decoded by FFmpeg.

    Args:
        path: the file.

    Raises:
        FileError: it is no video.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.name = str(path)
        self.skipped: list[str] = []
        with self._opened() as container:
            stream = container.streams.video[0]
            self.rate_per_s = float(stream.average_rate or _UNKNOWN_RATE)
            self.total: int | None = stream.frames or self._estimate(container)

    def _opened(self) -> Any:
        try:
            container = av.open(str(self._path))
        except (av.FFmpegError, OSError) as error:
            raise FileError(
                self._path, f"is no video that can be read ({_reason(error)})"
            ) from error
        if not container.streams.video:
            container.close()
            raise FileError(self._path, "holds no video")
        return container

    def _estimate(self, container: Any) -> int | None:
        if container.duration is None:
            return None
        return max(1, math.ceil(float(container.duration) / av.time_base * self.rate_per_s))

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture; damaged stretches are left out and told."""
        index, begin_s, shape = -1, None, None
        with self._opened() as container:
            for decoded in self._decoded(container):
                index += 1
                if index % every:
                    continue
                image = decoded.to_ndarray(format="rgb24")
                shape = shape or image.shape
                if image.shape != shape:
                    self.skipped.append(f"picture {index}: has another size than the first")
                    continue
                told_s = index / self.rate_per_s if decoded.time is None else float(decoded.time)
                begin_s = told_s if begin_s is None else begin_s
                yield Picture(
                    image=image, index=index, time_s=told_s - begin_s, name=f"picture {index}"
                )

    def _decoded(self, container: Any) -> Iterator[Any]:
        stream = container.streams.video[0]
        packets = container.demux(stream)
        count = damaged = 0
        while True:
            try:
                packet = next(packets, None)
                if packet is None:
                    break
                count += 1
                frames = packet.decode()
            except av.FFmpegError as error:
                damaged += 1
                if damaged == 1:
                    self.skipped.append(f"packet {count}: is damaged ({_reason(error)})")
                if damaged > count:  # no packet could be read at all: the file ends here
                    break
                continue
            yield from frames
        if damaged > 1:
            self.skipped.append(f"{damaged - 1} more damaged packets")


def _reason(error: Exception) -> str:
    return str(getattr(error, "strerror", None) or error)
