"""Compare two campaigns flight by flight: the same to the last digit, or at least in the outcome?

python benchmarks/same_flights.py runs/before runs/after
"""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

from uav_bt.campaign.flight_lines import FlightKey, comparable, key_of, read_flights
from uav_bt.campaign.store import FLIGHTS_FILE


def main() -> None:
    """Print a line for each mission."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    given = parser.parse_args()
    before, after = flights(given.before), flights(given.after)
    both, same, outcome = Counter[str](), Counter[str](), Counter[str]()
    for key in before.keys() & after.keys():
        one, other = before[key], after[key]
        both[key[0]] += 1
        same[key[0]] += comparable(one) == comparable(other)
        outcome[key[0]] += one["outcome"] == other["outcome"]
    for tree, count in sorted(both.items()):
        print(f"{tree}: {count} flights, {same[tree]} identical, {outcome[tree]} alike in outcome")


def flights(folder: Path) -> dict[FlightKey, dict[str, object]]:
    """Return the flights of a campaign's folder by tree, scene and seed."""
    return {key_of(flight): flight for flight in read_flights(folder / FLIGHTS_FILE).flights}


if __name__ == "__main__":
    main()
