"""Windows as a torch `Dataset`; in a module of its own, because torch is for training only."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from torch.utils.data import Dataset

from uav_bt.learning.dataset.index_file import flight_data
from uav_bt.learning.dataset.windows import FlightWindows, WindowConfig

__all__ = ["WindowDataset"]


class WindowDataset(Dataset[dict[str, torch.Tensor]]):
    """All windows of some records, by number, in a fixed order; safe with any number of workers.

    An item has `frames` (L, 3, H, W) uint8 RGB, `states` (L, 11) float32, `kind` () int64,
    `command` (4,) float32 and `flight` () int64; see `uav_bt.learning.dataset.windows.Window`.

    Args:
        records: the files.
        config: which frames go together.
        index_folder: where indices are kept; None: beside each record.

    Raises:
        FileError: a record is damaged, unfinished, empty, or of another camera.
        ValueRangeError: no window fits.
    """

    def __init__(
        self,
        records: Sequence[Path],
        config: WindowConfig | None = None,
        *,
        index_folder: Path | None = None,
    ) -> None:
        self.windows = FlightWindows([flight_data(path, index_folder) for path in records], config)

    def __len__(self) -> int:
        return len(self.windows)

    def __getitem__(self, index: int) -> dict[str, torch.Tensor]:
        """Return a window as tensors."""
        window = self.windows[index]
        return {
            "frames": torch.from_numpy(np.ascontiguousarray(window.frames.transpose(0, 3, 1, 2))),
            "states": torch.from_numpy(window.states),
            "kind": torch.tensor(window.kind),
            "command": torch.from_numpy(window.command.copy()),
            "flight": torch.tensor(window.flight),
        }
