"""Damaged files: every reader of files from outside, on mutated ones.

    python -m benchmarks.fuzz_files                    # 500 files of each kind
    python -m benchmarks.fuzz_files --cases 50 record  # a few of one kind

A reader may read a file or refuse it with an error of its own (`InputError`). Whatever else it
raises, and a process that ends, takes too long or too much memory, is a fault: the exit code is 1,
and the file is kept in the output folder, under the number of its case.
"""

from __future__ import annotations

import argparse
import random
import resource
import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from benchmarks.fuzz_mutations import MUTATIONS
from benchmarks.fuzz_seeds import SEEDS
from uav_bt.campaign.workers import FLOWN, REFUSED, WorkerPool
from uav_bt.groot.btlog import BtlogReader

TIME_LIMIT_S: Final = 20.0  # of wall time, on a machine that does other things, too
SLOW_S: Final = 3.0
MEMORY_BYTES: Final = 6 * 1024**3  # of addresses; OpenVINO and Rerun ask for more than they use
_SHOWN: Final = 10  # faults of a kind that are printed


# --- the readers, in their processes --------------------------------------------------------------


def _tree(path: Path) -> None:
    from uav_bt.errors import TreeError  # noqa: PLC0415 - each process imports what it needs
    from uav_bt.tree.loading.findings import errors_of  # noqa: PLC0415
    from uav_bt.tree.loading.loader import check_file  # noqa: PLC0415

    if findings := errors_of(check_file(path)):
        raise TreeError(path, findings[:3])


def _palette(path: Path) -> None:
    from uav_bt.tree.loading.palette import read_palette  # noqa: PLC0415

    read_palette(path)


def _scene(path: Path) -> None:
    from sim_bridge.twin.scene_file import load_scene  # noqa: PLC0415

    load_scene(path)


def _site(path: Path) -> None:
    from uav_bt.app.site import load_site  # noqa: PLC0415

    load_site(path)


def _camera(path: Path) -> None:
    from perception.camera.camera_file import load_camera  # noqa: PLC0415

    load_camera(path)


def _mapping(path: Path) -> None:
    from perception.segmentation.mapping import read_mapping  # noqa: PLC0415

    read_mapping(path)


def _script(path: Path) -> None:
    from uav_bt.tree.dry_run.script_file import read_script  # noqa: PLC0415

    read_script(path)


def _record(path: Path) -> None:
    from uav_bt.record.footage import footage  # noqa: PLC0415
    from uav_bt.record.info import record_info  # noqa: PLC0415
    from uav_bt.record.reader import RecordReader  # noqa: PLC0415

    record_info(path)
    reader = RecordReader(path)
    for moment in reader.moments(from_s=0.2):
        if moment.frame is not None and moment.frame.image is not None:
            moment.frame.frame()
    list(footage(reader))


def _replay(path: Path) -> None:
    from uav_bt.app.replay import ReplayOptions, replay  # noqa: PLC0415

    replay(path, ReplayOptions(masks="recorded"))


def _view(path: Path) -> None:
    from uav_bt.app.view.recorded import RecordedFlight  # noqa: PLC0415

    RecordedFlight(path).save(path.with_suffix(".rrd"))


def _film(path: Path) -> None:
    from uav_bt.app.view.recorded import RecordedFlight  # noqa: PLC0415

    RecordedFlight(path).film(path.with_suffix(".mp4"))


def _onnx(path: Path) -> None:
    from perception.segmentation.runtime import OnnxSegmenter  # noqa: PLC0415

    OnnxSegmenter(path)


def _weights(path: Path) -> None:
    from perception.segmentation.teacher import load_teacher  # noqa: PLC0415

    load_teacher(path)


def _flights(path: Path) -> None:
    from uav_bt.campaign.flight_lines import read_flights  # noqa: PLC0415
    from uav_bt.errors import FileError  # noqa: PLC0415

    if damaged := read_flights(path).damaged:
        raise FileError(path, "\n".join(damaged[:3]))


def _campaign(path: Path) -> None:
    from uav_bt.campaign.store import PLAN_FILE, read_plan  # noqa: PLC0415

    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    shutil.copyfile(path, folder / PLAN_FILE)
    read_plan(folder)


def _btlog(path: Path) -> None:
    with BtlogReader(path) as log:
        for _ in log:
            pass


def _picks(path: Path) -> None:
    from perception.segmentation.training.picks import read_picks  # noqa: PLC0415

    read_picks(path)


READERS: Final[Mapping[str, Callable[[Path], None]]] = {
    "tree": _tree,
    "palette": _palette,
    "scene": _scene,
    "site": _site,
    "camera": _camera,
    "mapping": _mapping,
    "script": _script,
    "record": _record,
    "replay": _replay,
    "view": _view,
    "film": _film,
    "onnx": _onnx,
    "weights": _weights,
    "flights": _flights,
    "campaign": _campaign,
    "btlog": _btlog,
    "picks": _picks,
}


def read_case(task: Mapping[str, str]) -> dict[str, Any]:
    """Read one file; a process of the pool calls it.

    Args:
        task: the kind, and the file's path.

    Raises:
        InputError: the file was refused, as it may be; anything else is a fault.
    """
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    READERS[task["kind"]](Path(task["path"]))
    return {}


# --- the command ----------------------------------------------------------------------------------


@dataclass
class Row:
    """What became of the files of one kind."""

    kind: str
    ends: Counter[str] = field(default_factory=Counter)  # read, refused, fault, slow
    faults: list[str] = field(default_factory=list)
    longest_s: float = 0.0


def fuzz(kind: str, cases: int, folder: Path, *, seed: int = 0, jobs: int = 2) -> Row:
    """Read mutated files of a kind.

    Args:
        kind: one of `READERS`.
        cases: how many.
        folder: where files are written; those of faults stay.
        seed: of the mutations.
        jobs: processes.
    """
    folder.mkdir(parents=True, exist_ok=True)
    seeds = SEEDS[kind](folder)
    row, pool = Row(kind), WorkerPool("benchmarks.fuzz_files:read_case", jobs)

    def run(number: int) -> tuple[int, Path, dict[str, Any], float]:
        path = folder / f"{number}{seeds[0].suffix}"
        rng = random.Random(f"{seed} {kind} {number}")  # noqa: S311 - the same files every time
        mutate = rng.choice(MUTATIONS[path.suffix])
        path.write_bytes(mutate(rng.choice(seeds).read_bytes(), rng))
        began_s = time.perf_counter()
        answer = pool.fly({"kind": kind, "path": str(path)}, TIME_LIMIT_S).result()
        return number, path, answer, time.perf_counter() - began_s

    try:
        for whole in seeds:
            answer = pool.fly({"kind": kind, "path": str(whole)}, TIME_LIMIT_S).result()
            if FLOWN not in answer:
                row.faults.append(f"{whole}: a whole file was refused: {answer}")
        with ThreadPoolExecutor(jobs) as threads:
            for done in threads.map(run, range(cases)):
                _note(row, *done)
    finally:
        pool.close()
    return row


def _note(row: Row, number: int, path: Path, answer: Mapping[str, Any], took_s: float) -> None:
    row.longest_s = max(row.longest_s, took_s)
    row.ends["slow"] += took_s > SLOW_S
    if FLOWN in answer or REFUSED in answer:
        row.ends["read" if FLOWN in answer else "refused"] += 1
        for left in path.parent.glob(f"{number}.*"):
            left.unlink()
        shutil.rmtree(path.with_suffix(""), ignore_errors=True)
        return
    row.ends["fault"] += 1
    row.faults.append(f"{path}: {answer['failed']:.200}")


def table(rows: Iterable[Row], cases: int) -> str:
    """Return the rows as a table in Markdown."""
    lines = [
        "| kind | files | read | refused | faults | over 3 s | longest, s |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for row in rows:
        counts = [row.ends[name] for name in ("read", "refused", "fault", "slow")]
        numbers = " | ".join(map(str, [cases, *counts]))
        lines.append(f"| {row.kind} | {numbers} | {row.longest_s:.1f} |")
    return "\n".join(lines)


def main() -> int:
    """Run the command and return its exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("kinds", nargs="*", default=[], help="default: all")
    parser.add_argument("--cases", type=int, default=500, help="files of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("runs/fuzz"))
    given = parser.parse_args()
    unknown = set(given.kinds) - set(READERS)
    if unknown:
        parser.error(f"unknown kinds: {', '.join(unknown)} (known: {', '.join(READERS)})")
    rows = []
    for kind in given.kinds or READERS:
        row = fuzz(kind, given.cases, given.out / kind, seed=given.seed, jobs=given.jobs)
        rows.append(row)
        print(f"{kind}: {dict(row.ends)}", file=sys.stderr)
        for fault in row.faults[:_SHOWN]:
            print(f"  {fault}", file=sys.stderr)
    print(table(rows, given.cases))
    return 1 if any(row.faults for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
