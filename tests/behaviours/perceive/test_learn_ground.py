"""LearnGround: fly around, then use what a thread has learned at a fixed time."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from behaviours.perceive.learn_ground import LearnGround
from perception.networks import inference_packages
from perception.segmentation.adaptation import learned_lab
from perception.segmentation.adaptation.head import GroundHead
from perception.segmentation.adaptation.learned_lab import LearnedPlace
from tests.perception.segmentation.adaptation.learned_world import STATEMENT
from uav_bt.board.flight_folder import FlightFolder
from uav_bt.errors import InputError, MissingDependencyError, UnknownNameError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import Hover

HEAD = GroundHead(weights=np.zeros(24), margin_weight=1.0, bias=0.0)
PLACE = LearnedPlace(head=HEAD, statement=STATEMENT, labels=())


def _turned(
    monkeypatch: pytest.MonkeyPatch, learned: LearnedPlace | InputError, lab: str = ""
) -> LeafBench:
    """Return a bench whose leaf has turned, and now waits for its thread."""

    def learn(*_given: object, **_named: object) -> LearnedPlace:
        if isinstance(learned, InputError):
            raise learned
        return learned

    monkeypatch.setattr(learned_lab, "learn_place", learn)
    bench = LeafBench(LearnGround, seconds=8.0, compute_s=2.0, lab=lab)
    for _ in range(200):
        assert live(bench, seconds=0.1) is Status.RUNNING
        if bench.proposed == Hover():
            return bench
    raise AssertionError("the turn has not ended")


def test_the_result_is_used_after_a_fixed_time(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = _turned(monkeypatch, PLACE)
    context = bench.leaf.mission
    for _ in range(18):
        assert live(bench, seconds=0.1) is Status.RUNNING
        assert context.learned.segmenter is None
    assert Status.SUCCESS in {live(bench, seconds=0.1) for _ in range(4)}
    assert isinstance(context.learned.segmenter, learned_lab.AdaptedSegmenter)
    assert "learned the ground from 3 frames" in bench.notes.events[-1].text


def test_a_flight_that_shows_too_little_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = _turned(monkeypatch, InputError("the flight shows too little"))
    answers = {live(bench, seconds=0.1) for _ in range(22)}
    assert Status.FAILURE in answers
    assert bench.leaf.mission.learned.segmenter is None


def test_a_lab_is_refused_before_the_take_off_without_its_package(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def absent() -> None:
        raise MissingDependencyError("the package onnx")

    monkeypatch.setattr(inference_packages, "import_onnx", absent)
    bench = LeafBench(LearnGround, lab="hall")
    bench.outputs = FlightFolder(tmp_path / "out")
    with pytest.raises(MissingDependencyError):
        bench.setup()
    LeafBench(LearnGround).setup()


def test_the_name_of_a_lab_is_checked_with_the_tree() -> None:
    with pytest.raises(InputError, match="the name of a lab consists of small letters"):
        LeafBench(LearnGround, lab="My Hall").setup()


def test_without_an_output_folder_the_lab_is_not_written(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = _turned(monkeypatch, PLACE, lab="hall")
    assert Status.SUCCESS in {live(bench, seconds=0.1) for _ in range(22)}
    assert "'hall' is not written: the flight has no output folder" in bench.notes.events[-1].text


def test_a_real_flight_states_its_date(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[object] = []

    def learn(*_given: object, made: str, **_named: object) -> LearnedPlace:
        given.append(made)
        return PLACE

    bench = _turned(monkeypatch, PLACE)
    leaf = bench.leaf
    assert isinstance(leaf, LearnGround)
    monkeypatch.setattr(learned_lab, "learn_place", learn)

    class Gathered:
        def footage(self) -> None:
            return None

    leaf._learn(Gathered())  # type: ignore[arg-type]
    leaf._context = replace(leaf._context, live=True)
    leaf._learn(Gathered())  # type: ignore[arg-type]
    assert given[0] == ""
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", str(given[1]))


def test_the_teacher_has_no_features_to_adapt() -> None:
    with pytest.raises(UnknownNameError, match="network to adapt 'teacher'"):
        LeafBench(LearnGround, model="teacher").setup()
