"""Picks: the file, and points drawn in a person's place."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from perception.segmentation.features import patch_slices
from perception.segmentation.training import picks
from tests.paper_lab import CLASSES, HELIPAD_H
from tests.perception.segmentation.patterned import PATTERNED, samples
from tests.worlds.tables import cases
from uav_bt.errors import FileError, ValueRangeError

HEADER = "image,x,y,class,origin\n"


def test_written_picks_come_back(tmp_path: Path) -> None:
    made = [
        picks.Pick(image="a.jpg", x=3, y=4, class_id=HELIPAD_H),
        picks.Pick(image='odd, "name".png', x=0, y=9, class_id=16, origin="simulated"),
    ]
    path = tmp_path / "picks.csv"
    picks.write_picks(path, made, CLASSES)
    assert picks.read_picks(path, CLASSES) == made
    assert path.read_text(encoding="utf-8").startswith(HEADER)


@pytest.mark.parametrize(("row", "message"), cases("perception")["bad_pick_rows"])
def test_a_bad_row_is_refused_with_its_line(tmp_path: Path, row: str, message: str) -> None:
    path = tmp_path / "picks.csv"
    for text, words in (
        (f"{HEADER}a.png,1,2,carpet,hand\n{row}\n", f"picks.csv:3: .*{message}"),
        (HEADER, "holds no picks"),
        (f"{row}\n", "csv:1: the columns must be"),
    ):
        path.write_text(text, encoding="utf-8")
        with pytest.raises(FileError, match=words):
            picks.read_picks(path, CLASSES)


def test_drawn_picks_lie_well_inside_their_class_on_seven_to_nine_pictures_each() -> None:
    exact = {name: ids for name, _, ids in samples(20, seed=4)}
    drawn, again = (
        picks.draw_picks(exact.items(), np.random.default_rng(0), patch_px=8, total=600)
        for _ in range(2)
    )
    assert drawn == again
    assert {pick.origin for pick in drawn} == {"simulated"}
    for pick in drawn:
        ids = exact[pick.image]
        assert ids[pick.y, pick.x] == pick.class_id
        patch = ids[patch_slices(pick.x, pick.y, patch_px=8, width_px=160, height_px=90)]
        assert (patch == pick.class_id).mean() > 0.8
    for class_id in PATTERNED:
        mine = [pick for pick in drawn if pick.class_id == class_id]
        assert 90 <= len(mine) <= 115
        assert 7 <= len({pick.image for pick in mine}) <= 9


def test_patches_count_every_pixel_of_their_class() -> None:
    (name, rgb, _) = next(samples(1, seed=0))
    pick = picks.Pick(image=name, x=40, y=40, class_id=1)
    gathered = picks.gather_patches([pick, pick], [(name, rgb)], 8, CLASSES)
    assert gathered.features.shape == (2, 190)
    assert gathered.colour_counts[1].sum() == gathered.colour_counts.sum() == 2 * 64
    outside = picks.Pick(image=name, x=400, y=4, class_id=1)
    with pytest.raises(ValueRangeError, match="outside the 160x90"):
        picks.gather_patches([outside], [(name, rgb)], 8, CLASSES)
    with pytest.raises(ValueRangeError, match=r"gone.jpg, which is not among"):
        picks.gather_patches([pick, replace(pick, image="gone.jpg")], [(name, rgb)], 8, CLASSES)
