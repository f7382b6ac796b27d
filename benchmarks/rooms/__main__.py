r"""Make furnished rooms, and train the network `any` on them.

    pip install coacd
    python -m benchmarks.rooms assets --furniture BlendSwap-CC-0.sh3f --pictures DIR --out runs/assets
    python -m benchmarks.rooms furnish runs/assets --use train --rooms 400 --out runs/rooms/train
    python -m benchmarks.rooms score runs/rooms/test
    python -m benchmarks.rooms train runs/rooms/train --views 150 --out runs/any.safetensors

docs/any-room.md states the packages of furniture and pictures, and their licences.
"""

from __future__ import annotations

import argparse
import json
import time
import zipfile
import zlib
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.rooms.furnish import FLOWN, Assets, Furniture, RoomPlan, write_room


def load_assets(folder: Path, use: str) -> Assets:
    """Return the assets of a folder for training or for testing.

    Args:
        folder: Written by `assets`.
        use: `train` or `test`.
    """
    listed = json.loads((folder / "furniture.json").read_text(encoding="utf-8"))
    furniture = [
        Furniture(path=folder / "furniture" / each["file"], size_m=tuple(each["size_m"]))
        for each in listed
        if each["use"] == use
    ]
    paths = sorted((folder / "pictures" / use).glob("*.jpg"))
    pictures = [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in paths]
    if not furniture or not pictures:
        raise SystemExit(f"{folder}: no furniture or no pictures for {use}")
    return Assets(furniture=furniture, photographs=pictures)


def use_of(name: str) -> str:
    """Return `test` for every fourth model, by its name, else `train`."""
    return "test" if zlib.crc32(name.encode()) % 4 == 0 else "train"


def make_assets(library: Path, pictures: Path, out: Path) -> None:
    """Write furniture as closed meshes, and copy the pictures; what exists is kept."""
    from benchmarks.rooms.furniture import (  # noqa: PLC0415  (coacd is needed here only)
        FINEST,
        convex_pieces,
        list_models,
        read_triangles,
        write_obj,
    )

    (out / "furniture").mkdir(parents=True, exist_ok=True)
    listed = []
    with zipfile.ZipFile(library) as archive:
        for model in list_models(archive):
            path = out / "furniture" / f"{model.name.lower()}.obj"
            if not path.exists():
                corners, triangles = read_triangles(archive.read(model.path).decode("latin-1"))
                if len(triangles) > FINEST:
                    continue
                write_obj(path, convex_pieces(corners, triangles))
                print(path, flush=True)
            listed.append(
                {
                    "file": path.name,
                    "size_m": model.size_m,
                    "author": model.author,
                    "use": use_of(model.name),
                }
            )
    (out / "furniture.json").write_text(json.dumps(listed, indent=1) + "\n", encoding="utf-8")
    for use in ("train", "test"):
        (out / "pictures" / use).mkdir(parents=True, exist_ok=True)
        for source in sorted((pictures / use).iterdir()):
            image = cv2.imread(str(source))
            scale = min(1.0, 512 / max(image.shape[:2]))
            small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            target = out / "pictures" / use / f"{source.stem.lower()}.jpg"
            cv2.imwrite(str(target), small, [cv2.IMWRITE_JPEG_QUALITY, 85])


def _furnish(seed: int, assets: Assets, plan: RoomPlan, out: Path, number: int) -> Path:
    rng = np.random.default_rng((seed, number))
    return write_room(out / f"room-{number:04d}", assets, rng, plan)


def furnish(assets: Assets, plan: RoomPlan, seed: int, count: int, out: Path) -> None:
    """Write rooms."""
    with ProcessPoolExecutor() as pool:
        list(pool.map(partial(_furnish, seed, assets, plan, out), range(count), chunksize=8))


def train(given: argparse.Namespace) -> None:
    """Render the images of rooms, and train the network on them."""
    from benchmarks.rooms.collection import RoomJob, render_rooms  # noqa: PLC0415  (OpenGL)
    from perception.networks.training.room_net import ROOM_FILES, RoomNet  # noqa: PLC0415  (torch)
    from perception.networks.training.room_run import (  # noqa: PLC0415  (torch)
        Progress,
        RoomTrainingConfig,
        train_room_net,
    )

    began_s = time.monotonic()

    def report(text: str) -> None:
        print(f"{time.monotonic() - began_s:7.1f} s  {text}", flush=True)

    rooms = sorted(given.rooms.glob("*/scenes/*[0-9].yaml"))
    jobs = [
        RoomJob(scene=str(scene), views=given.views, seed=number)
        for number, scene in enumerate(rooms)
    ]
    # Depth is learned in the labs, too. Their roles are left out, so that they stay unseen.
    jobs += [
        RoomJob(scene=name, views=given.views, seed=1000 + 50 * part + number, labelled=False)
        for number, name in enumerate(given.depth_scenes)
        for part in range(given.depth_parts)
    ]

    def advance(_stage: str, done: int, total: int) -> None:
        if done % 25 == 0:
            report(f"{done} of {total} scenes")

    images = render_rooms(jobs, given.workers, advance=advance)
    report(f"{len(images.rgb)} images of {len(jobs)} scenes")

    def progress(now: Progress, net: RoomNet) -> None:
        if now.step % 200 == 0:
            report(f"step {now.step}: {now.loss:.4f} {dict(now.terms)}")
        if now.step % 2000 == 0:
            ROOM_FILES.save(given.out, _copied(net), notes={"steps": now.step})

    config = RoomTrainingConfig(
        steps=given.steps,
        batch=given.batch,
        learning_rate=given.learning_rate,
        average=0.999 if given.device == "cuda" else 0.99,
        checkpoint_every=100 if given.checkpoint else 10**9,
        device=given.device,
    )
    start = None if given.start is None else ROOM_FILES.load(given.start)[0]
    net = train_room_net(
        images, config, start=start, checkpoint=given.checkpoint, progress=progress
    )
    notes = {"rooms": len(rooms), "images": len(images.rgb), "steps": given.steps}
    ROOM_FILES.save(given.out, net, notes=notes)
    report(f"network: {given.out}")


def export(weights: Path, rooms: Path, out: Path) -> None:
    """Write the ONNX file of a network in 8-bit integers, calibrated on images of rooms and lab."""
    from benchmarks.rooms.room_views import draw_views  # noqa: PLC0415  (OpenGL)
    from perception.networks.training.room_net import ROOM_FILES  # noqa: PLC0415  (torch)
    from sim_bridge.twin.scene_file import load_scene  # noqa: PLC0415
    from uav_bt.learning.exporting import CALIBRATION_VIEWS  # noqa: PLC0415
    from uav_bt.learning.views import twin_views  # noqa: PLC0415

    scenes = sorted(rooms.glob("*/scenes/*[0-9].yaml"))[:24]
    images = [
        view.rgb
        for number, scene in enumerate(scenes)
        for view in draw_views(load_scene(str(scene)), 6, number, level=True)
    ]
    images += [rgb for _, rgb, _ in twin_views(replace(CALIBRATION_VIEWS, views=12))]
    ROOM_FILES.export(weights, out, calibration=images)


def score(given: argparse.Namespace) -> None:
    """Score networks on rooms."""
    from benchmarks.rooms.score import score_rooms  # noqa: PLC0415  (OpenGL)
    from perception.networks.named import segmentation_file  # noqa: PLC0415
    from perception.segmentation.runtime import load_segmenter  # noqa: PLC0415  (OpenVINO)
    from uav_bt.lab.shipped import load_lab  # noqa: PLC0415

    scenes = [str(scene) for scene in sorted(given.rooms.glob("*/scenes/*[0-9].yaml"))]
    for model in given.model:
        path = segmentation_file(model)
        assert path is not None, "the teacher is no network"
        segmenter = load_segmenter(path, load_lab().classes)
        print(f"{model}, {len(scenes)} rooms:")
        print("\n".join(score_rooms(segmenter, scenes, given.views).lines()), flush=True)


def _copied(net: Any) -> Any:
    import copy  # noqa: PLC0415

    return copy.deepcopy(net).cpu()


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
    command.add_argument("--use", choices=["train", "test"], required=True)
    command.add_argument("--rooms", type=int, default=400)
    command.add_argument("--seed", type=int, default=0)
    command.add_argument("--flown", action="store_true", help="with passages, light and texture")
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("train", help="render and train")
    command.add_argument("rooms", type=Path)
    command.add_argument("--views", type=int, default=150, help="images of a room")
    command.add_argument("--depth-scenes", nargs="*", default=[], help="scenes without roles")
    command.add_argument("--depth-parts", type=int, default=4, help="sets of images of each")
    command.add_argument("--steps", type=int, default=20_000)
    command.add_argument("--batch", type=int, default=256)
    command.add_argument("--learning-rate", type=float, default=3e-3)
    command.add_argument("--start", type=Path, help="weights to begin with")
    command.add_argument("--checkpoint", type=Path, help="state of the run, to go on from")
    command.add_argument("--workers", type=int, default=0)
    command.add_argument("--device", default="cpu")
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("export", help="write the ONNX file")
    command.add_argument("weights", type=Path)
    command.add_argument("rooms", type=Path)
    command.add_argument("--out", type=Path, required=True)
    command = commands.add_parser("score", help="score networks on rooms")
    command.add_argument("rooms", type=Path)
    command.add_argument("--model", nargs="+", default=["any", "unet"])
    command.add_argument("--views", type=int, default=24, help="images of a room")
    given = parser.parse_args()
    if given.command == "assets":
        make_assets(given.furniture, given.pictures, given.out)
    elif given.command == "furnish":
        plan = FLOWN if given.flown else RoomPlan()
        furnish(load_assets(given.assets, given.use), plan, given.seed, given.rooms, given.out)
    elif given.command == "export":
        export(given.weights, given.rooms, given.out)
    elif given.command == "score":
        score(given)
    else:
        train(given)


if __name__ == "__main__":
    main()
