"""Images in records: lossless if required; invalid ones are refused."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uav_bt.errors import InputError
from uav_bt.record import messages
from uav_bt.record.images import decode_image, encode_image, fields, image_bytes, raw_image


def noise(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


@given(st.integers(1, 40), st.integers(1, 40), st.integers(0, 1000))
def test_a_lossless_image_comes_back_bit_for_bit(height: int, width: int, seed: int) -> None:
    image = noise(height, width, seed)
    message = messages.camera_image(image, 1_234_567_890_123, "lossless")
    assert np.array_equal(decode_image(image_bytes(message)), image)


def test_a_small_image_is_much_smaller_and_nearly_the_same() -> None:
    rows, columns = np.mgrid[0:90, 0:160]
    image = np.stack([rows * 2, columns, rows + columns], axis=-1).astype(np.uint8)
    data, name = encode_image(image, "high")
    assert name == "jpeg"
    assert len(data) < image.nbytes / 10
    assert np.abs(decode_image(data).astype(int) - image).mean() < 2.0  # red stays red


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"no image at all",
        b"\xff\xd8\xff\xff\xff\xff",
        encode_image(noise(9, 9), "high")[0][:20],
    ],
)
def test_what_is_no_image_is_refused(data: bytes) -> None:
    with pytest.raises(InputError, match="expected a PNG or JPEG image"):
        decode_image(data)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_raw_pixels_come_back_exactly(dtype: type) -> None:
    array = (np.random.default_rng(3).random((7, 5)) * 200).astype(dtype)
    back = raw_image(messages.raw(array, 5))
    assert back.dtype == dtype
    assert np.array_equal(back, array)


@given(st.binary(max_size=60))
def test_bytes_of_any_kind_are_read_or_refused(data: bytes) -> None:
    with suppress(InputError):
        assert all(number >= 0 for number in fields(data))


def test_an_image_without_data_is_refused() -> None:
    with pytest.raises(InputError, match="CompressedImage with data"):
        image_bytes(b"")
    with pytest.raises(InputError, match="RawImage"):
        raw_image(b"")
