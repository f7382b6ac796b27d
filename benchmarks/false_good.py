"""Trees that `check` calls good although they raise: there must be none.

    python -m benchmarks.false_good --trees 100

Each tree has one mistake. If `check` finds no error, the tree is ticked 2,000 times with leaves
that answer at random. Trees without a mistake tell how often `check` refuses what flies.
"""

from __future__ import annotations

import argparse
import logging
import random
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

from benchmarks.random_leaves import raises_within
from benchmarks.wrong_trees import random_tree, wrong_tree
from uav_bt.errors import InputError
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import check_text

TICKS: Final = 2_000


@dataclass(frozen=True)
class Case:
    """A tree and what became of it."""

    seed: int
    mistake: str
    text: str
    refused: str | None  # the first error of check
    raised: str | None  # the first error of its ticks; None also for a tree that does not load

    @property
    def is_false_good(self) -> bool:
        """Whether check found no error, and the tree raises."""
        return self.refused is None and self.raised is not None


def judge(
    seed: int,
    mistake: str,
    text: str,
    registry: NodeRegistry,
    *,
    ticks: int = TICKS,
    ticks_refused: bool = False,
) -> Case:
    """Check a tree, and tick it.

    Args:
        seed: of the random answers.
        mistake: name of the mistake.
        text: of the tree file.
        registry: the nodes that may occur.
        ticks: how many.
        ticks_refused: whether to tick a refused tree, too.
    """
    errors = errors_of(check_text(text, registry, path=Path("tree.xml")))
    refused = str(errors[0]) if errors else None
    raised = None
    if refused is None or ticks_refused:
        try:
            raised = raises_within(text, registry, ticks=ticks, seed=seed)
        except InputError as error:
            raised = str(error) if refused is None else None
    return Case(seed, mistake, text, refused, raised)


def wrong_cases(count: int, registry: NodeRegistry, *, first: int, ticks: int) -> list[Case]:
    """Judge trees with one mistake each.

    Args:
        count: how many.
        registry: the nodes that may occur.
        first: seed of the first tree; the others follow.
        ticks: of each tree that check calls good.
    """
    return [
        judge(seed, *wrong_tree(seed), registry, ticks=ticks)
        for seed in range(first, first + count)
    ]


def right_cases(count: int, registry: NodeRegistry, *, first: int, ticks: int) -> list[Case]:
    """Judge random trees without a mistake; those that check refuses are ticked, too."""
    texts = (
        (seed, ET.tostring(random_tree(random.Random(seed)), encoding="unicode"))  # noqa: S311
        for seed in range(first, first + count)
    )
    return [
        judge(seed, "none", text, registry, ticks=ticks, ticks_refused=True) for seed, text in texts
    ]


def main() -> int:
    """Judge trees and print a table; 1 if a tree that raises is called good."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trees", type=int, default=100)
    parser.add_argument("--ticks", type=int, default=TICKS)
    parser.add_argument("--seed", type=int, default=0, help="of the first tree")
    args = parser.parse_args()
    logging.disable(logging.WARNING)  # nodes that fail for an unknown key
    registry = NodeRegistry.installed()
    wrong = wrong_cases(args.trees, registry, first=args.seed, ticks=args.ticks)
    right = right_cases(args.trees, registry, first=args.seed, ticks=args.ticks)
    print(f"{'mistake':<20} {'trees':>6} {'refused':>8} {'flies':>6} {'false good':>11}")
    for name, cases in sorted(Counter(case.mistake for case in wrong).items()):
        mine = [case for case in wrong if case.mistake == name]
        refused = sum(case.refused is not None for case in mine)
        false = sum(case.is_false_good for case in mine)
        print(f"{name:<20} {cases:>6} {refused:>8} {cases - refused - false:>6} {false:>11}")
    false_good = [case for case in wrong + right if case.is_false_good]
    alarms = [case for case in right if case.refused is not None and case.raised is None]
    print(f"without a mistake: {len(right)} trees, {len(alarms)} refused that fly")
    for case in false_good:
        print(f"\nseed {case.seed}, {case.mistake}: {case.raised}\n{case.text}")
    for case in alarms:
        print(f"\nseed {case.seed} flies, refused: {case.refused}\n{case.text}")
    return 1 if false_good else 0


if __name__ == "__main__":
    sys.exit(main())
