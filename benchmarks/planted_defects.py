r"""Plant defects in copies of the code, and measure how long random flights take to find them.

    python -m benchmarks.planted_defects --out runs/planted
    python -m benchmarks.planted_defects --out runs/planted --minutes 6    # of wall time, each
    python -m benchmarks.planted_defects --out runs/planted --defects land-steps-back

`planted_edits.py` lists the defects. For each one the code flies as `uav-bt campaign TREE
--drone plain --faults random` does: the trees of both rules and of the survey in turn, each in all
training and validation scenes with different seeds, so that no two flights have the same faults.
They explore for 30 s instead of 90 or 180 s, so that more faults and landings are flown in the
same time. The defect is found by the first flight that

- does not succeed, where the same flight (tree, scene, seed) succeeds without the defect, or
- ends in the air, where the same flight without the defect ends on the ground.

The failed flight is reduced to its fewest boxes, movers and faults (`uav-bt shrink`), and the rest
is flown in the twin with images, with the defect and without. Flights without the defect are flown
once for all defects. Everything is kept in the folder, and the same command continues.

One process flies at a time. Hours are simulated, minutes are of wall time.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import shutil
import signal
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from benchmarks.planted_code import ROOT, Code
from benchmarks.planted_edits import DEFECTS, Defect
from benchmarks.planted_results import HEAD, Line, Search, difference
from uav_bt.campaign.flight_lines import key_of, read_flights
from uav_bt.campaign.store import FLIGHTS_FILE
from uav_bt.cli.shrink import FAULTS_FILE, SCENE_FILE
from uav_bt.errors import MissionError, UavBtError
from uav_bt.files import write_whole
from uav_bt.mission.judge import Outcome

TREES: Final = ("explore_and_land_segmentation", "explore_and_land_depth", "survey_and_land")
SCENES: Final = "train-*,val-*"
SHORT: Final = ("--set", "ExploreFor.duration_ms=30000")
_BLOCKS: Final = 1000  # more than a search flies
_BLOCK_SEEDS: Final = 2
_HUNG_S: Final = 240.0  # wall time of a hung flight; one of 300 s takes a minute on a busy core
_TWIN_S: Final = 900.0  # wall time of a flight with images that hangs
_SOUND: Final = "sound"
_DONE_FILE: Final = "done"
_RESULT_FILE: Final = "result.json"


@dataclass(frozen=True)
class Block:
    """Flights of one tree in all scenes, flown in one command.

    Attributes:
        tree: Name of the tree.
        first_seed: The first seed. No two blocks share a seed, because trees that are flown with
            the same seed have the same faults.
        seeds: Number of seeds.
    """

    tree: str
    first_seed: int
    seeds: int = _BLOCK_SEEDS

    @property
    def name(self) -> str:
        """Name of the folder."""
        return f"{self.first_seed}-{self.tree}"


def blocks() -> Iterator[Block]:
    """Return the blocks in the order in which they are flown."""
    for index in range(_BLOCKS):
        yield Block(TREES[index % len(TREES)], index * _BLOCK_SEEDS)


class Found(NamedTuple):
    """The flight that finds a defect, how it differs, and the folder of its campaign."""

    line: Line
    how: str
    folder: Path


def _suspect(line: Line) -> bool:
    return line["outcome"] != Outcome.SUCCESS.value or bool(line.get("airborne_at_end"))


def _wall_s(lines: Sequence[Line]) -> float:
    return sum(float(line.get("wall_s") or _HUNG_S) for line in lines)


def _fly(code: Code, block: Block, folder: Path) -> Sequence[Line]:
    """Return the flights of a block, flown now or kept.

    Raises:
        MissionError: The command refused something.
    """
    folder = folder / block.name
    words = ["campaign", block.tree, "--scenes", SCENES, "--seed-from", str(block.first_seed)]
    words += ["--flights", str(block.seeds), *SHORT, "--drone", "plain", "--faults", "random"]
    words += ["--workers", "1", "--timeout-s", f"{_HUNG_S:g}", "--out", str(folder)]
    done = folder / _DONE_FILE
    if not done.exists():
        log = folder.with_suffix(".log")
        if code.run(words, log) != 0:
            raise MissionError(f"uav-bt {shlex.join(words)} failed; see {log}")
        write_whole(done, "")
    return read_flights(folder / FLIGHTS_FILE).flights


class Sound:
    """The code without a defect, and its flights.

    Args:
        folder: Where both are kept.
        source: Folder with the packages.
    """

    def __init__(self, folder: Path, source: Path = ROOT) -> None:
        self.code = Code.copied(source, folder / "code")
        self._folder = folder

    def fly(self, block: Block) -> dict[Any, Line]:
        """Return the flights of a block by their key."""
        lines = _fly(self.code, block, self._folder / "flights")
        return {key_of(line): line for line in lines}


class Hunt:
    """The search for one defect.

    Args:
        defect: The defect that is planted.
        folder: Where code, flights and result are kept.
        sound: The code without the defect.
        minutes: Wall time after which the search, and the shrinking, are given up.
    """

    def __init__(self, defect: Defect, folder: Path, sound: Sound, minutes: float) -> None:
        self._code = Code.copied(sound.code.folder, folder / "code", defect)
        self._folder, self._sound, self._minutes = folder, sound, minutes

    def search(self) -> tuple[Search, Found | None]:
        """Fly until a flight finds the defect; return the search and that flight."""
        flown: list[Line] = []
        found: Found | None = None
        for block in blocks():
            if found is not None or _wall_s(flown) >= 60.0 * self._minutes:
                break
            lines = _fly(self._code, block, self._folder / "flights")
            found = self._first(block, lines)
            flown += lines if found is None else lines[: lines.index(found.line) + 1]
        search = Search(
            flights=len(flown),
            hours=sum(line.get("duration_s") or 0.0 for line in flown) / 3600.0,
            minutes=_wall_s(flown) / 60.0,
            limit_minutes=self._minutes,
            how=None if found is None else found.how,
        )
        return search, found

    def _first(self, block: Block, lines: Sequence[Line]) -> Found | None:
        """Return the first flight that finds the defect; None: none does."""
        for line in filter(_suspect, lines):
            how = difference(line, self._sound.fly(block)[key_of(line)])
            if how is not None:
                return Found(line, how, self._folder / "flights" / block.name)
        return None

    def shrink(self, found: Found) -> tuple[str | None, bool]:
        """Reduce a flight that found the defect, and fly the rest in the twin.

        The flight is flown in the twin as it is if the time is over before it is reduced.

        Returns:
            Number of faults, movers and boxes, None if it is not reduced; whether they find the
            defect in the twin.
        """
        out, log = self._folder / "smallest", self._folder / "shrink.log"
        line = found.line
        log.unlink(missing_ok=True)
        shutil.rmtree(out, ignore_errors=True)  # of a run that was stopped
        tree, seed = Path(line["tree"]).stem, str(line["seed"])
        words = ["shrink", str(found.folder), "--tree", tree, "--scene", line["scene"]]
        words += ["--seed", seed, "--out", str(out)]
        limit_s = 60.0 * self._minutes
        shrunk = self._code.run(words, log, goes_on=lambda passed_s: passed_s < limit_s) == 0
        words = ["fly", tree, *SHORT, "--seed", seed, "--profile", line["profile"], "--scene"]
        if not shrunk:
            return None, self._is_found_in_twin([*words, line["scene"], "--faults", "random"])
        counted = log.read_text(encoding="utf-8").split("remaining:")[1]
        words.append(str(out / SCENE_FILE))
        if (out / FAULTS_FILE).read_text(encoding="utf-8"):
            words += ["--faults", f"@{out / FAULTS_FILE}"]
        counts = re.findall(r"(?:faults|movers|boxes) (\d+)", counted)
        return ", ".join(counts), self._is_found_in_twin(words)

    def _is_found_in_twin(self, words: list[str]) -> bool:
        ours = self._in_twin(self._code, words, "planted")
        if not _suspect(ours):
            return False
        return difference(ours, self._in_twin(self._sound.code, words, _SOUND)) is not None

    def _in_twin(self, code: Code, words: list[str], name: str) -> Line:
        report = self._folder / f"twin-{name}.json"
        report.unlink(missing_ok=True)
        log = self._folder / f"twin-{name}.log"
        words = [*words, "--report", str(report)]
        code.run(words, log, goes_on=lambda passed_s: passed_s < _TWIN_S)
        if not report.exists():
            raise MissionError(f"uav-bt {shlex.join(words)} wrote no report; see {log}")
        line: Line = json.loads(report.read_text(encoding="utf-8"))
        return line


def hunt(defect: Defect, folder: Path, sound: Sound, minutes: float) -> Search:
    """Return the result for one defect, flown now or kept.

    Args:
        defect: The defect that is planted.
        folder: Where code, flights and result are kept.
        sound: The code without the defect.
        minutes: Wall time after which the search, and the shrinking, are given up.
    """
    file = folder / _RESULT_FILE
    if file.exists():
        kept = Search(**json.loads(file.read_text(encoding="utf-8")))
        if kept.left is not None or kept.limit_minutes >= minutes:
            return kept
    flies = Hunt(defect, folder, sound, minutes)
    search, found = flies.search()
    if found is not None:
        left, in_twin = flies.shrink(found)
        search = replace(search, left=left, in_twin=in_twin)
    write_whole(file, json.dumps(asdict(search), indent=2) + "\n")
    return search


def main() -> int:
    """Print a row for each defect when its search ends; return the exit code."""
    given = parse_arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # the command that flies is ended, too
    try:
        run(given.out.resolve(), given.defects, given.minutes)
    except UavBtError as error:
        print(f"{error}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
        return 1
    return 0


def parse_arguments() -> argparse.Namespace:
    """Return the options of the command line; a wrong usage exits with 2."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True, help="folder of code, flights, results")
    parser.add_argument("--minutes", type=float, default=25.0, help="of each search; default: 25")
    parser.add_argument(
        "--defects",
        nargs="+",
        default=[each.name for each in DEFECTS],
        choices=[each.name for each in DEFECTS],
        metavar="NAME",
        help="defects that are planted; default: all",
    )
    return parser.parse_args()


def run(out: Path, names: Sequence[str], minutes: float) -> None:
    """Search the defects with these names; see `hunt`."""
    sound = Sound(out / _SOUND)
    print(HEAD, flush=True)
    for defect in [each for each in DEFECTS if each.name in names]:
        print(hunt(defect, out / defect.name, sound, minutes).row(defect), flush=True)


if __name__ == "__main__":
    sys.exit(main())
