"""Score a network before and after a turn in rooms has adapted it, on images apart from the turn.

    python -m benchmarks.rooms.adapted runs/rooms/test/room-000[1-9]

Each room is a lab folder with a scene without a mark (`NAME-bare.yaml`). The drone takes off there
and turns once around; the labels come from the motion between its frames. The images are those of
`ViewKind.LEVEL`, with exact roles.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.rooms.score import RoomScore, score_rooms
from benchmarks.rooms.turn import fly_around
from perception.networks.named import ANY, ROLES, SHIPPED_UNET, segmentation_file
from perception.segmentation.adaptation.head import GroundHead
from perception.segmentation.adaptation.learned_lab import AdaptedSegmenter, learn_place
from perception.segmentation.adaptation.role_network import OnnxRoleNetwork
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Effects of a turn in a room.

    Attributes:
        room: Name of the room.
        before: IoU of ground of the frozen network.
        after: The same of the adapted one.
        note: Whether a new head was taken, or why nothing was learned.
        computed_s: Processor time of labels and fit.
    """

    room: str
    before: float
    after: float
    note: str
    computed_s: float

    def row(self) -> str:
        """Return a row of a Markdown table."""
        numbers = f"{self.before:.3f} | {self.after:.3f}"
        return f"| {self.room} | {numbers} | {self.note} | {self.computed_s:.0f} |"


def ground_iou(score: RoomScore) -> float:
    """Return the intersection over union of ground."""
    ground = ROLES.index("ground")
    right = score.confusion[ground, ground]
    either = score.confusion[ground].sum() + score.confusion[:, ground].sum() - right
    return float(right / either)


def measure(folder: Path, *, model: str, views: int, seed: int) -> Outcome:
    """Fly a turn in a room, adapt a network, and score it.

    Args:
        folder: Lab folder of the room.
        model: Network to adapt: one of roles, or a shipped one.
        views: Number of images.
        seed: Of the flight.
    """
    path = segmentation_file(model)
    if path is None:
        raise SystemExit(f"{model} is no network")
    scene = str(folder / "scenes" / f"{folder.name}-bare.yaml")
    gathered = fly_around(str(folder), scene, seed)
    if gathered.builder is None:
        raise SystemExit(f"the flight in {scene} gathered nothing")
    stated = load_lab().classes if model == SHIPPED_UNET else None
    network, classes = OnnxRoleNetwork(path, stated), load_lab(folder).classes
    head, began_s = GroundHead.unchanged(24), time.process_time()
    try:
        head = learn_place(gathered.builder.footage(), network, base="").head
        note = "new head" if head.is_new else "kept"
    except InputError as error:
        note = str(error).partition(":")[0]
    computed_s = time.process_time() - began_s
    before, after = (
        ground_iou(score_rooms(AdaptedSegmenter(network, each, classes), [scene], views))
        for each in (GroundHead.unchanged(24), head)
    )
    return Outcome(room=folder.name, before=before, after=after, note=note, computed_s=computed_s)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a table of rooms."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("rooms", nargs="+", type=Path)
    parser.add_argument("--model", default=ANY)
    parser.add_argument("--views", type=int, default=24, help="images of a room")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    print("| room | IoU before | after | head | s |\n|---|---|---|---|---|")
    found = []
    for folder in given.rooms:
        found.append(measure(folder, model=given.model, views=given.views, seed=given.seed))
        print(found[-1].row(), flush=True)
    before, after = (
        np.mean([getattr(each, name) for each in found]) for name in ("before", "after")
    )
    print(f"mean of {len(found)} rooms: {before:.3f} before, {after:.3f} after")


if __name__ == "__main__":
    main()
