"""The tables of `uav-bt net evaluate depth` as text."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any, Final

_Row = Mapping[str, Any]

# The paper's Table of point pairs by side of the patch: mean, median, RMSE, std, correlation.
_PAPER_PAIRS: Final = {
    1: (0.0740, 0.0597, 0.0988, 0.0655, 0.8342),
    3: (0.0736, 0.0589, 0.0980, 0.0647, 0.8353),
    5: (0.0744, 0.0578, 0.0994, 0.0659, 0.8308),
    7: (0.0751, 0.0623, 0.1000, 0.0661, 0.8299),
    9: (0.0775, 0.0621, 0.1025, 0.0671, 0.8246),
}
_PAPER_DISTANCE: Final = (0.1440, 0.1628, 0.3714)  # mean, median, maximum
_WIDTH: Final = 9


def depth_report(result: _Row) -> Iterator[str]:
    """Give the lines of a result of `uav_bt.learning.evaluation.evaluate_depth`."""
    yield (
        f"{result['model']} on {result['images']} images of {', '.join(result['scenes'])}, "
        f"{result['masks']} masks, telemetry of profile '{result['profile']}'"
    )
    yield (
        f"  {result['edges']} edges of obstacles in {result['images_with_edges']} images, half "
        f"of them longer than {_text(result['median_edge_m'])} m; {result['points']} points"
    )
    yield "  errors in metres; 'known': the share for which a method has an estimate"
    for table, rows in result["tables"].items():
        yield ""
        yield from _PRINTERS[table](rows)


def _line(head: str, values: Sequence[Any]) -> str:
    return f"  {head:<16}" + "".join(f"{_text(value):>{_WIDTH}}" for value in values)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.4f}" if isinstance(value, float) else str(value)


def _known(error: _Row) -> str:
    return f"{error['valid'] / error['total']:.0%}" if error["total"] else "-"


def _pairs(rows: Sequence[_Row]) -> Iterator[str]:
    figures = ("mean_m", "median_m", "rmse_m", "std_m", "correlation")
    for (across, patch_px), block in groupby(rows, lambda row: (row["across"], row["patch_px"])):
        patch = "no patch" if patch_px == 1 else f"{patch_px}x{patch_px} median"
        what = "Distances between points on two faces" if across else "Lengths of obstacles' edges"
        yield f"{what}, {patch}"
        yield _line("", ("mean", "median", "RMSE", "std", "corr", "known"))
        for row in block:
            error = row["error"]
            yield _line(row["method"], [*(error[name] for name in figures), _known(error)])
        if not across:
            yield _line("the paper", _PAPER_PAIRS[patch_px])


def _distance(rows: Sequence[_Row]) -> Iterator[str]:
    figures = ("mean_m", "median_m", "max_m", "p95_m", "bias_m")
    for what, block in groupby(rows, lambda row: str(row["what"])):
        name = "obstacles and ground" if what == "both" else what
        yield f"Distances from the camera along the ray, 0.3 to 5 m, {name}"
        yield _line("", ("mean", "median", "max", "p95", "bias", "known"))
        for row in block:
            error = row["error"]
            yield _line(row["method"], [*(error[name] for name in figures), _known(error)])
        if what == "both":
            yield _line("the paper", _PAPER_DISTANCE)


def _sensitivity(rows: Sequence[_Row]) -> Iterator[str]:
    yield "Sensitivity: mean error (median) of edges without a patch, and of distances"
    methods = list(dict.fromkeys(row["method"] for row in rows))
    yield f"  {'':<16}" + "".join(f"{method:^38}" for method in methods)
    yield f"  {'':<16}" + f"{'edges':>18}{'distances':>20}" * len(methods)
    for change, block in groupby(rows, lambda row: str(row["change"])):
        cells = "".join(
            f"{_pair_of(row['pairs']):>18}{_pair_of(row['distance']):>20}" for row in block
        )
        yield f"  {change:<16}{cells}"


def _pair_of(error: _Row) -> str:
    return f"{_text(error['mean_m'])} ({_text(error['median_m'])})"


def _corridor(rows: Sequence[_Row]) -> Iterator[str]:
    yield "Corridor against exact depth; 'clear': walls moved by 0.1 m would not change the truth"
    yield f"  {'front':>6}{'f':>5}  {'':<12}" + "".join(
        f"{head:>13}"
        for head in (
            *("no depth", "intruded", "false alarms", "(clear)"),
            *("misses", "(clear)", "nearest, m"),
        )
    )
    for row in rows:
        counts = [
            f"{row['without_depth']}/{row['images']}",
            row["intruded"],
            *(row[name] for name in ("false_alarms", "clear_false_alarms")),
            *(row[name] for name in ("misses", "clear_misses")),
            row["nearest_error_m"],
        ]
        yield f"  {row['front_m']:>6.1f}{row['focal_factor']:>5.1f}  {row['method']:<12}" + "".join(
            f"{_text(count):>13}" for count in counts
        )


_PRINTERS: Final[Mapping[str, Callable[[Sequence[_Row]], Iterator[str]]]] = {
    "pairs": _pairs,
    "distance": _distance,
    "sensitivity": _sensitivity,
    "corridor": _corridor,
}
