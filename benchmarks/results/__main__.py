"""Measure all that `docs/results.md` states, and write that page.

    python -m benchmarks.results                     # what is missing, then the page
    python -m benchmarks.results --only lab depth    # these entries of plan.yaml

`plan.yaml` has the commands, `page.md.j2` the words of the page. `docs/results/` keeps a line of
each flight and the figures; campaigns work in `runs/results/`. The command goes on where it was
stopped. Exit code 0: done; 1: a figure does not reproduce, or was not measured; 2: refused.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.results.figures import Figures, differences, read_summary
from benchmarks.results.measuring import Results
from benchmarks.results.page import PAGE, page_of
from uav_bt.errors import InputError
from uav_bt.files import write_whole

KEPT = Path("docs/results")


def main() -> int:
    """Measure, write, compare; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="entries of the plan")
    parser.add_argument("--page", action="store_true", help="measure nothing, write the page")
    parser.add_argument("--compare", type=Path, metavar="FOLDER", help="of other results")
    given = parser.parse_args()
    try:
        if given.compare is not None:
            problems = differences(read_summary(KEPT), read_summary(given.compare))
        else:
            results = Results(KEPT)
            problems = [] if given.page else results.measure(given.only)
            problems += write_page(results)
    except InputError as error:
        print(f"Error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        problems = ["stopped; the same command goes on"]
    print("\n".join(problems) or "nothing is missing, all figures reproduce")
    return 1 if problems else 0


def write_page(results: Results) -> list[str]:
    """Write the page and its figures, or return what it lacks."""
    figures = Figures(results)
    try:
        write_whole(PAGE, page_of(figures))
    except InputError as error:
        return [f"no page: {error}"]
    figures.write()
    return []


if __name__ == "__main__":
    sys.exit(main())
