"""Windows over time: a few frames in a rhythm, the states at them, and what was told next.

windows = FlightWindows([flight_data(path) for path in paths], WindowConfig(length=4, stride_s=0.5))
window = windows[0]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.learning.dataset.flight_data import FlightData
from uav_bt.learning.dataset.images import PictureStore

__all__ = ["FlightWindows", "Window", "WindowConfig"]


@dataclass(frozen=True, kw_only=True)
class WindowConfig:
    """Which frames go together."""

    length: int = 4  # frames in a window
    stride_s: float = 0.5  # between them; the paper's 15 frames
    every_s: float = 0.1  # from one window's end to the next one's: a tick, so that none is lost
    # A frame may lie off its place by this much: frames come at a rhythm of their own.
    tolerance_s: float = 0.06
    size_px: tuple[int, int] = (224, 112)  # width, height: the masks' size
    keep_pictures: int = 256  # decoded, in memory: 19 MB at the default size

    def __post_init__(self) -> None:
        if self.length < 1 or self.keep_pictures < self.length:
            raise ValueRangeError(
                "a window needs a length of 1 or more and as many pictures in memory, got "
                f"{self.length} and {self.keep_pictures}"
            )
        if not (self.stride_s > 0.0 and self.every_s > 0.0 and self.tolerance_s >= 0.0):
            raise ValueRangeError(
                "stride_s and every_s must be positive and tolerance_s not negative, got "
                f"{self.stride_s}, {self.every_s}, {self.tolerance_s}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Window:
    """L frames in the order of time, and the command that followed the last one."""

    frames: NDArray[np.uint8]  # (L, H, W, 3) RGB
    states: NDArray[np.float32]  # (L, 11): `flight_data.STATE_FIELDS`, when each frame came in
    captured_s: NDArray[np.float64]  # (L,) of the mission clock
    kind: int  # of the movement sent on seeing the last frame: `commands.MOVEMENT_KINDS`
    command: NDArray[np.float32]  # (4,) of it: `commands.values_of`
    flight: int  # the flight's place among those given


class FlightWindows(Sequence[Window]):
    """All windows of some flights, in the order of the flights and of time.

    Args:
        flights: all of one camera.
        config: which frames go together.

    Raises:
        FileError: a flight's camera is another one than the first one's.
        ValueRangeError: no window fits.
    """

    def __init__(self, flights: Sequence[FlightData], config: WindowConfig | None = None) -> None:
        self.config = config or WindowConfig()
        self.flights = tuple(flights)
        self._store = PictureStore(self.config.size_px, keep=self.config.keep_pictures)
        _check_cameras(self.flights)
        places = [windows_of(flight, self.config) for flight in self.flights]
        self._flight = np.repeat(np.arange(len(places)), [len(part) for part in places])
        if not len(self._flight):
            raise ValueRangeError(
                f"no window of {self.config.length} frames {self.config.stride_s} s apart fits "
                f"into {len(self.flights)} flights; take fewer frames or a smaller stride"
            )
        self._places = np.concatenate(places)

    def __len__(self) -> int:
        return len(self._flight)

    def __getitem__(self, index: int) -> Window:  # type: ignore[override]  # no slices
        """Return a window; its pictures are decoded now.

        Raises:
            IndexError: there is none.
            FileError: a record was changed or damaged meanwhile.
        """
        number, places = int(self._flight[index]), self._places[index]
        flight = self.flights[number]
        ticks = flight.frame_tick[places]
        return Window(
            frames=np.stack([self._store.picture(flight, int(place)) for place in places]),
            states=flight.states[ticks],
            captured_s=flight.captured_s[places],
            kind=int(flight.kinds[ticks[-1]]),
            command=flight.commands[ticks[-1]],
            flight=number,
        )

    @property
    def kinds(self) -> NDArray[np.int64]:
        """The targets' kinds, (N,), without decoding a picture: for weights of classes."""
        return np.array(
            [
                self.flights[number].kinds[self.flights[number].frame_tick[places[-1]]]
                for number, places in zip(self._flight, self._places, strict=True)
            ],
            dtype=np.int64,
        )


def windows_of(flight: FlightData, config: WindowConfig) -> NDArray[np.int64]:
    """Return the places of each window's frames in a flight, (K, L), in the order of time."""
    captured_s = flight.captured_s
    ends = thinned(captured_s, config.every_s)
    back_s = config.stride_s * np.arange(config.length - 1, -1, -1)
    wanted_s = captured_s[ends][:, None] - back_s
    after = np.clip(np.searchsorted(captured_s, wanted_s), 1, max(len(captured_s) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(captured_s) - 1)
    nearer = wanted_s - captured_s[before] <= captured_s[after] - wanted_s
    places = np.where(nearer, before, after)
    off_s = np.abs(captured_s[places] - wanted_s)
    rising = (np.diff(places, axis=1) > 0).all(axis=1)
    fits = (off_s <= config.tolerance_s).all(axis=1) & rising
    return np.asarray(places[fits], dtype=np.int64)


def thinned(times_s: NDArray[np.float64], every_s: float) -> NDArray[np.int64]:
    """Return the places of times that are so far apart, or almost: frames have their own rhythm."""
    kept: list[int] = []
    for place, time_s in enumerate(times_s):
        if not kept or time_s - times_s[kept[-1]] >= 0.75 * every_s:
            kept.append(place)
    return np.array(kept, dtype=np.int64)


def _check_cameras(flights: Sequence[FlightData]) -> None:
    for flight in flights:
        if flight.camera != flights[0].camera:
            raise FileError(
                flight.path,
                f"was flown with another camera than {flights[0].path} ({flight.camera} against "
                f"{flights[0].camera}); train on the flights of one camera",
            )
