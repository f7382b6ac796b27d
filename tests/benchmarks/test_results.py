"""`make results`: a stopped run goes on, and what does not reproduce is named."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from benchmarks.results import __main__ as command
from benchmarks.results.figures import Figure, Figures, differences, read_summary
from benchmarks.results.measuring import Results
from benchmarks.results.page import PAGE, page_of
from uav_bt.errors import InputError

ROOT = Path(__file__).parents[2]
PLAN = """\
hover:
  command: uav-bt campaign hover_and_look --drone plain --scenes val-a --flights 2 --seed-from 5
sum:
  command: python -c "print('trusted 3 of 4,000 scales')"
"""


@pytest.mark.flight
def test_results_go_on_in_another_clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    clones = [tmp_path / name for name in ("first", "second")]
    plan = tmp_path / "plan.yaml"
    plan.write_text(PLAN)
    whole = []
    for clone in clones:
        (clone / "kept").mkdir(parents=True)
        monkeypatch.chdir(clone)
        if whole:  # the first flight and no work folder: that is what was committed
            shutil.copy(clones[0] / "kept/hover.json", clone / "kept")
            lines = (clones[0] / "kept/hover.jsonl").read_text().splitlines(keepends=True)
            (clone / "kept/hover.jsonl").write_text(lines[0])
        results = Results(Path("kept"), plan)
        assert results.measure() == []
        figures = Figures(results)
        hovered = figures.landed("hover/hover_and_look")
        assert (hovered.value, hovered.n) == (2, 2)
        assert figures.mean("hover", "duration_s").n == 2
        assert figures.ratio("sum", "trusted") == Figure(
            3, *figures.used["sum: trusted"][1:3], 4000
        )
        whole.append(figures.used)
    assert differences(*whole) == []
    kept = results.flights("hover")
    assert kept[0] == Results(clones[0] / "kept", plan).flights("hover")[0]


def test_the_page_is_that_of_the_kept_results() -> None:
    figures = Figures(Results(ROOT / command.KEPT))
    assert page_of(figures) == (ROOT / PAGE).read_text(encoding="utf-8")
    assert figures.used == read_summary(ROOT / command.KEPT)


def test_what_does_not_reproduce_is_named() -> None:
    kept = {
        "a": Figure(1.0, 0.9, 1.1),
        "b": Figure(2.0, 1.9, 2.1),
        "c": Figure(3.0),
        "d": Figure(4),
    }
    other = {"a": Figure(1.2, 1.1, 1.3), "b": Figure(2.3, 2.2, 2.4), "c": Figure(9.0)}
    named = [line.partition(":")[0] for line in differences(kept, other)]
    assert named == ["b", "d"]


def test_what_is_missing_or_unknown_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    figures = Figures(Results(tmp_path))
    for ask in (lambda: figures.landed("lab"), lambda: figures.measured("depth", "flown")):
        with pytest.raises(InputError, match=r"'(lab|depth)'.*`make results`"):
            ask()
    monkeypatch.chdir(tmp_path)
    for words in (["--only", "labb"], ["--compare", "elsewhere"]):
        monkeypatch.setattr("sys.argv", ["results", *words])
        assert command.main() == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
