"""LearnGround: fly around, then use what a thread has learned at a fixed time."""

from __future__ import annotations

import numpy as np
import pytest

from behaviours.perceive.learn_ground import LearnGround
from perception.segmentation.adaptation import learned_lab
from perception.segmentation.adaptation.head import GroundHead
from perception.segmentation.adaptation.learned_lab import LearnedPlace
from perception.segmentation.adaptation.place_statement import PlaceStatement
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import Hover

STATEMENT = PlaceStatement(
    base="0",
    width_px=448,
    height_px=224,
    focal_px=(326.0, 289.7),
    height_m=1.5,
    frames=3,
    known_share=0.8,
    agreement=0.9,
    feature_mean=(0.0,) * 24,
    feature_spread=(1.0,) * 24,
)
HEAD = GroundHead(weights=np.zeros(24), margin_weight=1.0, bias=0.0)
PLACE = LearnedPlace(head=HEAD, statement=STATEMENT, labels=())


def _turned(monkeypatch: pytest.MonkeyPatch, learned: LearnedPlace | InputError) -> LeafBench:
    """Return a bench whose leaf has turned, and now waits for its thread."""

    def learn(*_given: object, **_named: object) -> LearnedPlace:
        if isinstance(learned, InputError):
            raise learned
        return learned

    monkeypatch.setattr(learned_lab, "learn_place", learn)
    bench = LeafBench(LearnGround, seconds=8.0, compute_s=2.0)
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


def test_the_teacher_has_no_features_to_adapt() -> None:
    with pytest.raises(UnknownNameError, match="network to adapt 'teacher'"):
        LeafBench(LearnGround, model="teacher").setup()
