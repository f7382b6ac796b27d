"""The next image: of the use that is short of picks, and the one of the least sure teacher."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from perception.segmentation.training.pick_session import ImageChooser, PickSession, wanted_use
from tests.perception.segmentation.training import pick_places
from tests.perception.segmentation.training.pick_places import CRATE, FLOOR, PLACE, session_of
from uav_bt.errors import ValueRangeError

BROWN = (125, 105, 50)  # between floor and crate


def _images(folder: Path, *shown: Sequence[tuple[int, int, int]], checks: str = "") -> PickSession:
    uses = {}
    for number, colours in enumerate(shown):
        pick_places.write_image(folder / "frames" / f"{number}.png", *colours, seed=number)
        uses[f"{number}.png"] = "check" if str(number) in checks else "train"
    return session_of(folder, uses)


def _pick(session: PickSession, image: str, *, right: str = "crate") -> None:
    session.paint(image, [(x, y) for x in range(5, 70, 4) for y in range(5, 90, 4)], "floor")
    session.paint(image, [(x, y) for x in range(90, 155, 4) for y in range(5, 90, 4)], right)


def test_the_least_sure_image_comes_next(tmp_path: Path) -> None:
    clear = (FLOOR, CRATE)
    session = _images(tmp_path, clear, clear, clear, (FLOOR, BROWN, CRATE), clear)
    _pick(session, "0.png")
    image, reason = ImageChooser(session.images, PLACE).choose(session.picks, "0.png")
    assert image == "3.png"
    assert "least sure of it, of 4" in reason


def test_a_new_teacher_follows_new_picks(tmp_path: Path) -> None:
    session = _images(tmp_path, (FLOOR, CRATE), (FLOOR, BROWN), (BROWN, FLOOR), (CRATE, FLOOR))
    chooser = ImageChooser(session.images, PLACE)
    for image, right, asked in (("0.png", "crate", "3.png"), ("1.png", "pad", "2.png")):
        _pick(session, image, right=right)
        ids = chooser.class_map(asked, session.picks)
        assert ids.shape == (324, 576)
        assert set(np.unique(ids[:, 50:200])) == {PLACE.id_of(right)}
        assert set(np.unique(ids[:, 380:530])) == {PLACE.id_of("floor")}


def test_without_a_teacher_images_far_from_the_others_come(tmp_path: Path) -> None:
    """A teacher does not learn from images for the check."""
    session = _images(tmp_path, *[(FLOOR,)] * 9)
    chooser = ImageChooser(session.images, PLACE)
    for shown, following in (("0.png", "8.png"), ("8.png", "4.png"), ("4.png", "2.png")):
        assert chooser.choose(session.picks, shown)[0] == following
    session = _images(tmp_path, (FLOOR, CRATE), (FLOOR, CRATE), checks="0")
    _pick(session, "0.png")
    chooser = ImageChooser(session.images, PLACE)
    assert chooser.choose(session.picks)[1] == "far from the others"
    with pytest.raises(ValueRangeError, match="needs picks of two classes"):
        chooser.class_map("1.png", session.picks)


def test_each_image_without_picks_is_offered_once_before_any_comes_again(tmp_path: Path) -> None:
    session = _images(tmp_path, *[(FLOOR, CRATE)] * 4)
    chooser = ImageChooser(session.images, PLACE)
    _pick(session, "0.png")
    found = [str(chooser.choose(session.picks)[0]) for _ in range(6)]
    assert set(found[:3]) == set(found[3:]) == {"1.png", "2.png", "3.png"}


def test_one_image_in_five_is_for_the_check() -> None:
    picked: list[str] = []
    for _ in range(20):
        picked.append(wanted_use(picked))
        checks, total = picked.count("check"), len(picked)
        assert checks == 0 if total < 5 else total / 5 <= checks <= total / 5 + 1


def test_the_use_that_is_short_comes_next(tmp_path: Path) -> None:
    session = _images(tmp_path, *[(FLOOR, CRATE)] * 7, checks="56")
    chooser = ImageChooser(session.images, PLACE)
    for name in ("0.png", "1.png", "2.png", "3.png"):
        _pick(session, name)
    assert chooser.choose(session.picks)[0] in {"5.png", "6.png"}
    for picked, wanted in (("5.png", "6.png"), ("6.png", "4.png"), ("4.png", None)):
        _pick(session, picked)
        assert chooser.choose(session.picks)[0] == wanted
