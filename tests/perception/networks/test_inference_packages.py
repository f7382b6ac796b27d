"""The processor's instructions that inference leaves out."""

from __future__ import annotations

from pathlib import Path

import pytest

from perception.networks import inference_packages

WITH_TILES = "flags\t\t: fpu avx2 avx512_vnni amx_bf16 amx_tile amx_int8\n"


def _environment(tmp_path: Path, info: str, **before: str) -> dict[str, str]:
    path = tmp_path / "cpuinfo"
    path.write_text(info, encoding="utf-8")
    environment = dict(before)
    inference_packages._spare_amx(environment, path)
    return environment


def test_tile_instructions_are_left_out_where_they_are_announced(tmp_path: Path) -> None:
    capped = _environment(tmp_path, WITH_TILES)
    assert capped == {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE_FP16"}


@pytest.mark.parametrize("info", ["flags\t\t: fpu avx2 avx_vnni\n", "Features : asimd\n", ""])
def test_a_processor_without_tiles_is_not_limited(tmp_path: Path, info: str) -> None:
    """With a cap, one that has VNNI but no AVX-512 would lose it."""
    assert _environment(tmp_path, info) == {}
    environment: dict[str, str] = {}
    inference_packages._spare_amx(environment, tmp_path / "no such file")
    assert environment == {}


@pytest.mark.parametrize("name", ["ONEDNN_MAX_CPU_ISA", "DNNL_MAX_CPU_ISA"])
def test_what_a_person_has_set_stays(tmp_path: Path, name: str) -> None:
    assert _environment(tmp_path, WITH_TILES, **{name: "AVX2"}) == {name: "AVX2"}
