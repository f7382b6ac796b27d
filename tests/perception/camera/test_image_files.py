"""Image files as stored and as shown."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from perception.camera.image_files import exif_orientation, read_image
from perception.camera.orientation import UPRIGHT


@pytest.mark.parametrize("value", range(1, 9))
def test_the_orientation_of_a_photograph_turns_its_stored_rows_as_viewers_do(
    tmp_path: Path, value: int
) -> None:
    """All eight values of the EXIF tag, on an image whose four quarters differ."""
    stored = np.kron(np.array([[20, 90], [160, 230]], np.uint8), np.ones((16, 32), np.uint8))
    exif = Image.Exif()
    exif[0x0112] = value
    path = tmp_path / "photograph.jpg"
    Image.fromarray(stored).convert("RGB").save(path, quality=98, exif=exif)

    raw = read_image(path, colour=True, as_stored=True)
    shown = read_image(path, colour=True, as_stored=False)
    assert raw.shape == (32, 64, 3)
    assert shown.shape == ((32, 64, 3) if value < 5 else (64, 32, 3))
    assert np.abs(exif_orientation(path).image(raw).astype(int) - shown).max() <= 2


def test_a_photograph_without_an_orientation_is_upright(tmp_path: Path) -> None:
    for name in ("plain.jpg", "plain.png"):
        Image.new("RGB", (8, 4)).save(tmp_path / name)
        assert exif_orientation(tmp_path / name) == UPRIGHT
    (tmp_path / "cut.jpg").write_bytes(b"\xff\xd8\xff\xe1\0\x10Exif\0\0II*\0\xff\xff\xff\xff")
    assert exif_orientation(tmp_path / "cut.jpg") == UPRIGHT
