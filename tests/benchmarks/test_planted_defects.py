"""Planted defects: every edit fits today's code, and a search ends with the right flight."""

from __future__ import annotations

import json
import os
import re
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

from benchmarks.planted_code import Code
from benchmarks.planted_defects import TREES, Sound, blocks, hunt
from benchmarks.planted_edits import DEFECTS, Defect
from benchmarks.planted_results import Search, difference
from uav_bt.errors import FileError

ROOT = Path(__file__).parents[2]

MARK = Defect(
    name="mark",
    file="behaviours/mark.py",
    sound="PLANTED = False",
    planted="PLANTED = True",
    wrong="The flight with seed 2 touches a box.",
)
# A product that flies nothing: flights with an odd seed are aborted by their fault, and the flight
# with seed 2 touches a box with the defect.
PRODUCT = """
import json, sys
from pathlib import Path
from behaviours.mark import PLANTED

def line(tree, seed):
    how = ("aborted", "critical battery") if seed % 2 else ("success", "landed")
    how = ("collision", "touched box") if PLANTED and seed == 2 else how
    return {"tree": f"{tree}.xml", "scene": "train-a", "seed": seed, "outcome": how[0],
            "reason": how[1], "profile": "lab", "duration_s": 360.0, "wall_s": 6.0}

def value(option):
    return sys.argv[sys.argv.index(option) + 1]

command = sys.argv[1]
if command == "campaign":
    file = Path(value("--out")) / "flights.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    first = int(value("--seed-from"))
    lines = [line(sys.argv[2], first + index) for index in range(int(value("--flights")))]
    file.write_text("".join(json.dumps(line) + "\\n" for line in lines))
elif command == "shrink":
    out = Path(value("--out"))
    out.mkdir()
    (out / "scene.yaml").write_text("name: small")
    (out / "faults.txt").write_text("late@explore\\n")
    print(f"remaining: faults 1, movers 0, boxes 2; {out}")
elif command == "fly":
    assert value("--faults").endswith("faults.txt")
    Path(value("--report")).write_text(json.dumps(line(sys.argv[2], int(value("--seed")))))
elif command == "wait":
    import os, time
    print(os.getpid(), flush=True)
    time.sleep(60)
"""


@pytest.fixture
def product(tmp_path: Path) -> Path:
    """Return a folder with the packages of a product that flies nothing."""
    root = tmp_path / "product"
    for package in ("uav_bt", "behaviours", "perception", "sim_bridge", "trees"):
        (root / package).mkdir(parents=True)
    (root / "uav_bt" / "__main__.py").write_text(PRODUCT)
    (root / MARK.file).write_text("PLANTED = False\n")
    return root


@pytest.mark.parametrize("defect", DEFECTS, ids=lambda defect: defect.name)
def test_an_edit_fits_the_code_and_what_it_leaves_compiles(defect: Defect) -> None:
    text = (ROOT / defect.file).read_text(encoding="utf-8")
    edited = defect.edited(text)
    assert edited != text
    compile(edited, defect.file, "exec")


def test_there_are_twenty_defects_of_which_ten_were_fixed_once() -> None:
    assert len({defect.name for defect in DEFECTS}) == len(DEFECTS) == 20
    fixed = [defect.fixed_in for defect in DEFECTS if defect.fixed_in is not None]
    assert len(set(fixed)) == len(fixed) == 10
    assert all(re.fullmatch("[0-9a-f]{8}", commit) for commit in fixed)
    assert all(re.fullmatch(r"[A-Z][^.]*\.", defect.wrong) for defect in DEFECTS)


@pytest.mark.parametrize("text", ["", "PLANTED = False\nPLANTED = False\n"])
def test_an_edit_of_changed_code_is_refused(text: str) -> None:
    with pytest.raises(FileError, match=r"defect 'mark' expects its text once and finds it [02]"):
        MARK.edited(text)


FLOWN = {"outcome": "success", "reason": "landed", "airborne_at_end": False}
HIT = {**FLOWN, "outcome": "collision", "reason": "touched box"}
ABORTED = {**FLOWN, "outcome": "aborted", "reason": "critical battery"}
LEFT = {"outcome": "error", "reason": "SDK", "airborne_at_end": True}


@pytest.mark.parametrize(
    ("line", "sound", "expected"),
    [
        (FLOWN, FLOWN, None),
        (FLOWN, HIT, None),
        (HIT, FLOWN, "collision: touched box"),
        (HIT, ABORTED, "collision: touched box"),
        (ABORTED, HIT, None),
        (LEFT, {**LEFT, "airborne_at_end": False}, "left in the air: SDK"),
        (LEFT, LEFT, None),
    ],
)
def test_a_flight_finds_a_defect_where_it_ends_worse_than_the_sound_one(
    line: dict[str, Any], sound: dict[str, Any], expected: str | None
) -> None:
    assert difference(line, sound) == expected


def test_a_copy_is_made_once_and_the_original_stays(product: Path, tmp_path: Path) -> None:
    code = Code.copied(product, tmp_path / "code", MARK)
    assert (code.folder / MARK.file).read_text() == "PLANTED = True\n"
    assert (product / MARK.file).read_text() == "PLANTED = False\n"
    assert Code.copied(product, tmp_path / "code", MARK) == code
    (product / "trees" / "mission.xml").write_text("<root/>")
    with pytest.raises(FileError, match="holds other code than today's"):
        Code.copied(product, tmp_path / "code", MARK)


def test_a_command_is_stopped_when_its_time_is_over(product: Path, tmp_path: Path) -> None:
    pids: list[int] = []

    def goes_on(_: float) -> bool:
        pids.extend(map(int, (tmp_path / "log").read_text().split()))
        return not pids

    assert Code(product).run(["wait"], tmp_path / "log", goes_on=goes_on) is None
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)


def test_a_search_ends_with_the_flight_that_fails_by_the_defect(
    product: Path, tmp_path: Path
) -> None:
    sound = Sound(tmp_path / "sound", product)
    found = hunt(MARK, tmp_path / "mark", sound, 1.0)
    assert found == Search(
        flights=3,
        hours=pytest.approx(0.3),
        minutes=pytest.approx(0.3),
        limit_minutes=1.0,
        how="collision: touched box",
        left="1, 0, 2",
        in_twin=True,
    )
    compared = sorted(path.name for path in (tmp_path / "sound" / "flights").glob("*.log"))
    assert compared == [f"0-{TREES[0]}.log", f"2-{TREES[1]}.log"]
    row = found.row(MARK)
    assert row == "| mark | - | yes | 0.30 | 0.3 | 3 | collision: touched box | yes | 1, 0, 2 |"


def test_blocks_take_the_trees_in_turn_and_share_no_seed() -> None:
    flown = list(islice(blocks(), 6))
    assert [block.tree for block in flown] == [*TREES, *TREES]
    seeds = [block.first_seed + index for block in flown for index in range(block.seeds)]
    assert seeds == list(range(len(seeds)))


def test_a_result_is_kept_unless_there_is_more_time(product: Path, tmp_path: Path) -> None:
    sound = Sound(tmp_path / "sound", product)
    given_up = Search(flights=9, hours=1.0, minutes=6.0, limit_minutes=6.0)
    file = tmp_path / "mark" / "result.json"
    file.parent.mkdir()
    file.write_text(json.dumps(vars(given_up)))
    assert hunt(MARK, file.parent, sound, 6.0) == given_up
    assert hunt(MARK, file.parent, sound, 7.0).how == "collision: touched box"


def test_a_flight_that_cannot_be_reduced_flies_in_the_twin_as_it_is(
    product: Path, tmp_path: Path
) -> None:
    main = product / "uav_bt" / "__main__.py"
    main.write_text(
        PRODUCT.replace("    out.mkdir()", "    sys.exit(2)").replace(
            'value("--faults").endswith("faults.txt")', 'value("--faults") == "random"'
        )
    )
    found = hunt(MARK, tmp_path / "mark", Sound(tmp_path / "sound", product), 1.0)
    assert (found.flights, found.left, found.in_twin) == (3, None, True)
