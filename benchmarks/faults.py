r"""Inject faults into flights and judge the reactions.

    python -m benchmarks.faults --out runs/faults                       # all kinds, all phases
    python -m benchmarks.faults --kind video-lost~3 late=0.7 --phase explore land
    python -m benchmarks.faults --drone anafi:127.0.0.2 --kind black deaf --phase explore
    python -m benchmarks.faults --list

Each flight is a line of flights.jsonl in the output folder, written at once: the same command goes
on where it was stopped. A right reaction: nothing but the ground touched, inside its edge, motors
off at the end, the report whole, and the fault named; docs/faults.md says where less is asked for.

Exit code 0: all reactions are right; 1: some are not; 2: something was refused.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from benchmarks.fault_flight import KINDS, Case
from benchmarks.fault_pilots import fly_each
from benchmarks.fault_reactions import EXPECTED, Facts, problems, survived
from benchmarks.loopback_drone import loopback_address
from uav_bt import app
from uav_bt.errors import FileError, InputError, UavBtError
from uav_bt.files import reading, write_whole, writing
from uav_bt.testing.faults import Fault
from uav_bt.tree.shipped import resolve_tree
from uav_bt.types import MissionPhase

PHASES = (
    MissionPhase.TAKE_OFF,
    MissionPhase.EXPLORE,
    MissionPhase.APPROACH,
    MissionPhase.CENTER,
    MissionPhase.LAND,
)
LINES_FILE, TABLE_FILE = "flights.jsonl", "table.md"
# What happens before the first phase begins can only be refused from the start on.
_FROM_START = ("no-take-off",)


def shortened(tree: str, explore_s: float, folder: Path) -> Path:
    """Write a mission with its time-outs set to a duration; return the file.

    Raises:
        InputError: the mission has no time-out, or the file cannot be written.
    """
    source = resolve_tree(tree)
    with reading(source):
        text = source.read_text(encoding="utf-8")
    limit = r'\b(Timeout msec|duration_ms)="\d+"'
    short, count = re.subn(limit, rf'\1="{1000 * explore_s:.0f}"', text)
    if count == 0:
        raise FileError(
            source,
            'has no <Timeout msec="..."> and no duration_ms="...", which --explore-s would set',
        )
    path = folder / f"{source.stem}-{explore_s:g}s.xml"
    write_whole(path, short)
    return path


def make_cases(args: argparse.Namespace, tree: Path) -> list[Case]:
    """Return the flights that are asked for, by kind, then by phase."""
    cases = {}
    for kind in args.kind or KINDS:
        name, wave, duration = kind.partition("~")
        for phase in args.phase:
            place = "start" if name in _FROM_START else phase
            place += "" if "+" in place or place == "start" else f"+{args.after_s:g}"
            fault = Fault.parse(f"{name}@{place}{wave}{duration}", KINDS)
            cases[str(fault)] = Case(
                fault=str(fault),
                tree=str(tree),
                scene=args.scene,
                seed=args.seed,
                drone=args.drone,
                networks=args.networks,
                time_limit_s=args.time_limit_s,
                on_pad=not args.land_anywhere,
            )
    return list(cases.values())


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A flight that has been flown, judged by the rules of now."""

    case: Case
    facts: Facts
    wall_s: float

    @classmethod
    def of(cls, line: dict[str, Any]) -> Self:
        """Return the result in a line of the file."""
        facts = Facts(**line["facts"])
        return cls(case=Case(**line["case"]), facts=facts, wall_s=line["wall_s"])

    @property
    def reaction(self) -> str:
        """Its mistakes, or that it has none."""
        if self.facts.began_s is None:
            return "not reached"
        fault = self.case.parsed
        return "; ".join(problems(EXPECTED[fault.kind.name], fault.phase, self.facts)) or "right"

    def __str__(self) -> str:
        end = self.facts.error or f"{self.facts.outcome}: {self.facts.reason}"
        return f"{self.case.fault:32s}{self.reaction}  [{end}; {self.wall_s} s]"


def read_lines(path: Path) -> dict[Case, str]:
    """Return the whole lines of the file; a last line that was cut is left out.

    Raises:
        FileError: the file cannot be read, or is damaged.
    """
    if not path.exists():
        return {}
    with reading(path):
        texts = path.read_text(encoding="utf-8").splitlines()
    lines = {}
    for number, text in enumerate(texts, start=1):
        try:
            lines[Flown.of(json.loads(text)).case] = text
        except (ValueError, KeyError, TypeError) as error:
            if number < len(texts):
                raise FileError(path, f"damaged: {error}", line=number) from error
    return lines


def fly_all(cases: Sequence[Case], folder: Path, workers: int) -> list[Flown]:
    """Fly the missing cases and return all flights, in the order of the cases."""
    path = folder / LINES_FILE
    lines = read_lines(path)
    missing = [case for case in cases if case not in lines]
    print(f"{len(cases)} flights, {len(cases) - len(missing)} of them are there", flush=True)
    if missing:
        write_whole(path, "".join(f"{line}\n" for line in lines.values()))  # without a cut one
        with ExitStack() as stack:
            stack.enter_context(writing(path))
            out = stack.enter_context(path.open("a", encoding="utf-8"))
            flights = stack.enter_context(closing(fly_each(missing, folder / "reports", workers)))
            for case, line in flights:
                lines[case] = json.dumps(line)
                print(lines[case], file=out, flush=True)
                print(Flown.of(line), flush=True)
    return [Flown.of(json.loads(lines[case])) for case in cases]


def table(flights: Iterable[Flown]) -> str:
    """Return the reactions as a Markdown table, a row for each kind and a column for each phase."""
    rows: dict[str, dict[str, str]] = {}
    for flown in flights:
        kind, _, place = flown.case.fault.partition("@")
        place, wave, duration = place.partition("~")
        rows.setdefault(kind + wave + duration, {})[place] = flown.reaction.replace("|", "/")
    places = list(dict.fromkeys(place for row in rows.values() for place in row))
    text = [f"| fault | {' | '.join(places)} |", f"|{'---|' * (len(places) + 1)}"]
    text += [
        f"| {kind} | {' | '.join(row.get(place, '') for place in places)} |"
        for kind, row in rows.items()
    ]
    return "\n".join(text) + "\n"


def parse_arguments(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """Return the options, by default those of the command line; a wrong usage exits with 2."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--list", action="store_true", help="print the kinds of faults and exit")
    parser.add_argument(
        "--kind", nargs="+", metavar="KIND[=LEVEL][~SECONDS]", help="default: all kinds, for ever"
    )
    parser.add_argument(
        "--phase",
        nargs="+",
        default=list(PHASES),
        metavar="PHASE[+SECONDS]",
        help="where they begin, or start+SECONDS of mission time; default: %(default)s",
    )
    parser.add_argument("--after-s", type=float, default=1.0, help="from a phase's begin [1]")
    parser.add_argument("--tree", default="explore_and_land_segmentation", help="[%(default)s]")
    parser.add_argument("--explore-s", type=float, default=20.0, help="the tree's time-outs [20]")
    parser.add_argument("--scene", default="train-a", help="[train-a]")
    parser.add_argument("--seed", type=int, default=1, help="[1]")
    parser.add_argument(
        "--drone",
        default="twin",
        help="plain flies without images; anafi:127.x.x.x flies a loopback ANAFI over Olympe, "
        "served for each flight; no truth is known then, and its reports count [twin]",
    )
    parser.add_argument("--networks", action="store_true", help="instead of exact masks")
    parser.add_argument("--time-limit-s", type=float, default=120.0, help="of a flight [120]")
    parser.add_argument("--land-anywhere", action="store_true", help="the tree ends on no pad")
    parser.add_argument("--workers", type=int, default=1, help="flights at once [1]")
    parser.add_argument("--out", type=Path, default=Path("runs/faults"), help="[%(default)s]")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly and print the table; print one line about input that is refused.

    Args:
        arguments: words of the command line; None: those of this process.

    Returns:
        The exit code.
    """
    try:
        return run(parse_arguments(arguments))
    except InputError as error:
        print(f"{error}", file=sys.stderr)
        return 2
    except UavBtError as error:
        print(f"{error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on from here", file=sys.stderr)
    return 1


def run(args: argparse.Namespace) -> int:
    """Fly and print the table; return the exit code."""
    if args.list:
        for kind in KINDS.values():
            level = "" if kind.level is None else f" [{kind.level:g} {kind.unit}]"
            print(f"{kind.name:18s}{kind.what}{level}")
        return 0
    if args.workers > 1 and loopback_address(args.drone) is not None:
        raise InputError(f"'{args.drone}' flies one flight at a time: leave --workers out")
    with writing(args.out):
        args.out.mkdir(parents=True, exist_ok=True)
    cases = make_cases(args, shortened(args.tree, args.explore_s, args.out))
    app.check(cases[0].tree)
    cases[0].make_drone()
    flights = fly_all(cases, args.out, args.workers)
    text = table(flights)
    write_whole(args.out / TABLE_FILE, text)
    right = sum(flown.reaction == "right" for flown in flights)
    lives = sum(survived(flown.facts) for flown in flights)
    print(f"\n{text}\n{right} of {len(flights)} reactions right, {lives} flights survived")
    return 0 if right == len(flights) else 1


if __name__ == "__main__":
    sys.exit(main())
