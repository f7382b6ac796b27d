"""Strokes over super-pixels: painted, erased, taken back, and written at once."""

import math
from pathlib import Path

import pytest

from perception.segmentation.training.pick_session import PickSession
from perception.segmentation.training.picks import Pick, read_picks
from tests.perception.segmentation.training import pick_places
from tests.perception.segmentation.training.pick_places import CRATE, FLOOR, PLACE, session_of
from uav_bt.errors import FileError

LEFT = [(10, y) for y in range(0, 90, 2)]  # a stroke down the floor
MIDDLE = [(x, 45) for x in range(0, 160, 2)]  # a stroke across floor and crate


@pytest.fixture
def session(tmp_path: Path) -> PickSession:
    pick_places.write_image(tmp_path / "frames" / "a.png", FLOOR, CRATE)
    pick_places.write_image(tmp_path / "frames" / "b.png", CRATE, FLOOR)
    return session_of(tmp_path, {"a.png": "train", "b.png": "check"})


def _regions(session: PickSession, image: str = "a.png") -> list[int]:
    found = session.images.super_pixels(image)
    return [found.at(pick.x, pick.y) for pick in session.picks if pick.image == image]


def test_a_stroke_gives_each_super_pixel_one_pick(session: PickSession) -> None:
    session.paint("a.png", LEFT, "floor")
    found = session.images.super_pixels("a.png")
    assert _regions(session) == list(dict.fromkeys(found.at(x, y) for x, y in LEFT))
    assert len(session.picks) > 5
    for pick, region in zip(session.picks, _regions(session), strict=True):
        touched = [point for point in LEFT if found.at(*point) == region]
        middle = found.innermost_of(region)
        assert (pick.x, pick.y) in touched
        assert math.dist((pick.x, pick.y), middle) == min(math.dist(p, middle) for p in touched)
    assert read_picks(session.path, PLACE) == session.picks
    assert session.counts() == {"wall": 0, "floor": len(session.picks), "crate": 0, "pad": 0}
    assert session.picked_images() == {"train": 1, "check": 0}
    before = list(session.picks)
    session.paint("a.png", LEFT[:5], "floor")  # again: it changes nothing, and is no stroke
    assert session.picks == before
    session.undo()
    assert session.picks == []


def test_another_class_replaces_the_pick(session: PickSession) -> None:
    session.paint("a.png", LEFT, "floor")
    session.add("b.png", 1, 1, "pad")
    session.paint("a.png", MIDDLE, "crate")
    regions = _regions(session)
    assert len(regions) == len(set(regions))
    assert {PLACE.names[pick.class_id] for pick in session.picks} == {"floor", "crate", "pad"}
    crossed = regions.index(session.images.super_pixels("a.png").at(10, 45))
    mine = [pick for pick in session.picks if pick.image == "a.png"]
    assert mine[crossed].class_id == PLACE.id_of("crate")


def test_the_eraser_removes_the_picks_of_its_super_pixels(session: PickSession) -> None:
    session.paint("a.png", MIDDLE, "crate")
    session.paint("b.png", MIDDLE, "crate")
    found = session.images.super_pixels("a.png")
    gone = {found.at(x, y) for x, y in MIDDLE[:20]}
    before = len(_regions(session, "b.png"))
    session.erase("a.png", MIDDLE[:20])
    assert gone.isdisjoint(_regions(session))
    assert _regions(session)
    assert len(_regions(session, "b.png")) == before
    assert read_picks(session.path, PLACE) == session.picks


def test_a_click_takes_the_nearest_pick_only(session: PickSession) -> None:
    x, y = session.images.super_pixels("a.png").innermost_of(0)
    session.add("a.png", x, y, "floor")
    session.add("a.png", x + 1, y, "crate")
    session.erase("a.png", [(x + 1, y)])
    assert [pick.class_id for pick in session.picks] == [PLACE.id_of("floor")]
    session.add("a.png", x, y, "crate")
    session.paint("a.png", [(x, y)], "floor")  # of two classes, one of them this one
    assert [pick.class_id for pick in session.picks] == [PLACE.id_of("floor")]


def test_undo_brings_back_what_a_stroke_replaced(session: PickSession) -> None:
    session.paint("a.png", LEFT, "floor")
    painted = list(session.picks)
    session.erase("a.png", LEFT[:3])
    session.paint("a.png", MIDDLE, "crate")
    assert (session.undo(), session.undo()) == ("a.png", "a.png")
    assert session.picks == painted
    assert read_picks(session.path, PLACE) == painted
    assert (session.undo(), session.undo()) == ("a.png", None)
    assert session.picks == []
    assert not session.path.exists()


def test_earlier_picks_are_gone_on_with(session: PickSession, tmp_path: Path) -> None:
    session.paint("a.png", LEFT, "floor")
    again = session_of(tmp_path, {"a.png": "train", "b.png": "check"})
    assert again.undo() is None  # the strokes of another session stay
    again.add("b.png", 2, 2, "crate")
    added = Pick(image="b.png", x=2, y=2, class_id=2)
    assert read_picks(session.path, PLACE) == [*session.picks, added]
    # Picks of another program are not overwritten.
    with pytest.raises(FileError, match="was changed by another program"):
        session.add("a.png", 5, 5, "floor")
    assert read_picks(session.path, PLACE) == again.picks
    # A pick outside its image does not stop a stroke.
    session.path.write_text("image,x,y,class,origin\na.png,500,5,floor,hand\n", encoding="utf-8")
    again = session_of(tmp_path, {"a.png": "train"})
    again.paint("a.png", LEFT, "crate")
    again.erase("a.png", LEFT)
    assert [pick.x for pick in again.picks] == [500]
