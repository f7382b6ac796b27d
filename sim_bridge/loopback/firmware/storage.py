"""Commands and events of the memory card: free space, media, formatting."""

from __future__ import annotations

from typing import Final

from sim_bridge.loopback.firmware.core import Core, Part
from sim_bridge.loopback.firmware.publisher import Values
from sim_bridge.loopback.media import MAX_BYTES, MediaStore
from sim_bridge.loopback.world import WorldState
from uav_bt.types import FlyingState

_DEFAULT_PERIOD_S: Final = 1  # monitoring period if a client gives none


class Storage(Part):
    """Publishes the content of the card; formats it on the ground, which deletes all media.

    Args:
        core: shared state of the parts.
        media: content of the card.
    """

    def __init__(self, core: Core, media: MediaStore) -> None:
        super().__init__(core)
        self._media = media
        self._period_s = 0  # monitoring period; 0: off
        self._monitored_s = 0.0
        self.handlers = {
            "user_storage.format": self._format,
            "user_storage.format_with_type": self._format,
            "user_storage.start_monitoring": self._start_monitoring,
            "user_storage.stop_monitoring": self._stop_monitoring,
        }
        publish = core.publisher.state
        publish(
            "user_storage.capabilities",
            supported_features={"format_when_ready_allowed", "format_result_evt_supported"},
        )
        publish("user_storage.supported_formatting_types", supported_types={"full", "quick"})
        publish("mediastore.state", state="indexed")
        self._publish_info("")
        self._publish_state(self._file_system)
        self._publish_counters()
        media.subscribe(lambda _: self._publish_counters())

    def update(self, state: WorldState) -> None:
        """Publish the free space if a client monitors it."""
        if self._period_s and state.time_s - self._monitored_s >= self._period_s:
            self._monitor(state.time_s)

    @property
    def _file_system(self) -> str:
        return "unknown" if self._media.absent else "ready"

    def _format(self, values: Values, state: WorldState) -> None:
        notify = self._core.publisher.notify
        if state.flying is not FlyingState.LANDED:
            notify("user_storage.format_result", result="denied")
            return
        if self._media.absent:
            notify("user_storage.format_result", result="error")
            return
        self._publish_state("formatting")
        self._media.format()
        self._publish_info(values["label"])
        notify("user_storage.format_result", result="success")
        self._publish_state("ready")

    def _start_monitoring(self, values: Values, state: WorldState) -> None:
        self._period_s = values["period"] or _DEFAULT_PERIOD_S
        self._publish_state(self._file_system)
        self._monitor(state.time_s)

    def _stop_monitoring(self, _values: Values, _state: WorldState) -> None:
        self._period_s = 0
        self._publish_state(self._file_system)

    def _monitor(self, time_s: float) -> None:
        self._monitored_s = time_s
        self._core.publisher.refresh("user_storage.monitor", available_bytes=self._media.free_bytes)

    def _publish_info(self, label: str) -> None:
        product = self._core.settings.value("common.SettingsState.ProductNameChanged", "name")
        self._core.publisher.state("user_storage.info", name=label or product, capacity=MAX_BYTES)

    def _publish_state(self, file_system: str) -> None:
        self._core.publisher.state(
            "user_storage.state",
            physical_state="undetected" if self._media.absent else "available",
            file_system_state=file_system,
            attribute=set(),
            monitor_enabled=int(self._period_s > 0),
            monitor_period=self._period_s,
        )

    def _publish_counters(self) -> None:
        photos = len(self._media)
        self._core.publisher.state(
            "mediastore.counters",
            video_media_count=0,
            photo_media_count=photos,
            video_resource_count=0,
            photo_resource_count=photos,
        )
