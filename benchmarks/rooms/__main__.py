"""Make furnished rooms, and train the network `any` on them.

    python -m benchmarks.rooms assets --furniture LIBRARY.sh3f --pictures DIR --out runs/assets
    python -m benchmarks.rooms furnish runs/assets --use train --rooms 480 --out runs/rooms/train
    python -m benchmarks.rooms train runs/rooms/train --views 110 --out runs/any.safetensors
    python -m benchmarks.rooms export runs/any.safetensors runs/rooms/train --out runs/any.onnx
    python -m benchmarks.rooms score runs/rooms/test

perception/weights/any.md describes the steps, and lists the packages and licences.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.rooms.assets import USES, load_assets, make_assets
from benchmarks.rooms.furnish import FLOWN, Assets, Furnisher, RoomPlan
from benchmarks.rooms.training import export_any, train_any
from benchmarks.rooms.views import SCENES, ViewKind, score_rooms
from benchmarks.segmentation import load_network
from perception.networks.weights_file import SHIPPED_UNET
from uav_bt.lab.shipped import load_lab


def furnish(seed: int, assets: Assets, plan: RoomPlan, out: Path, number: int) -> Path:
    """Write a room."""
    rng = np.random.default_rng((seed, number))
    return Furnisher(out / f"room-{number:04d}", assets, rng, plan).write()


def score(rooms: Path, models: list[str], views: int) -> None:
    """Print the scores of networks on rooms."""
    scenes = [str(scene) for scene in sorted(rooms.glob(SCENES))]
    for model in models:
        segmenter = load_network(model, load_lab().classes)
        for kind in (ViewKind.LEVEL, ViewKind.DOWN):
            print(f"{model}, {len(scenes)} rooms, {kind.value} views:")
            print("\n".join(score_rooms(segmenter, scenes, views, kind)), flush=True)


def main() -> None:
    """Run one of the commands."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("assets", help="convert furniture and pictures")
    command.add_argument("--furniture", type=Path, required=True, help="library, .sh3f")
    command.add_argument("--pictures", type=Path, required=True, help="folders train and test")
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("furnish", help="write rooms as lab folders")
    command.add_argument("assets", type=Path)
    command.add_argument("--use", choices=USES, required=True)
    command.add_argument("--rooms", type=int, default=480)
    command.add_argument("--seed", type=int, default=0)
    command.add_argument("--flown", action="store_true", help="with passages, light and texture")
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("train", help="render and train")
    command.add_argument("rooms", type=Path)
    command.add_argument("--views", type=int, default=110, help="images of a room")
    command.add_argument("--depth-scenes", nargs="*", default=[], help="scenes without roles")
    command.add_argument("--depth-parts", type=int, default=6, help="sets of images of each")
    command.add_argument("--steps", type=int, default=13_000)
    command.add_argument("--batch", type=int, default=256)
    command.add_argument("--workers", type=int, default=0)
    command.add_argument("--device", default="cpu")
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("export", help="write the ONNX file")
    command.add_argument("weights", type=Path)
    command.add_argument("rooms", type=Path)
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("score", help="score networks on rooms")
    command.add_argument("rooms", type=Path)
    command.add_argument("--model", nargs="+", default=["any", SHIPPED_UNET])
    command.add_argument("--views", type=int, default=24, help="images of a room")
    given = parser.parse_args()
    if given.command == "assets":
        make_assets(given.furniture, given.pictures, given.out)
    elif given.command == "furnish":
        assets, plan = load_assets(given.assets, given.use), FLOWN if given.flown else RoomPlan()
        one = partial(furnish, given.seed, assets, plan, given.out)
        with ProcessPoolExecutor() as pool:
            list(pool.map(one, range(given.rooms), chunksize=8))
    elif given.command == "train":
        train_any(given)
    elif given.command == "export":
        export_any(given.weights, given.rooms, given.out)
    else:
        score(given.rooms, given.model, given.views)


if __name__ == "__main__":
    main()
