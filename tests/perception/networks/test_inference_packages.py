"""The processor's instructions that inference leaves out."""

from __future__ import annotations

from pathlib import Path

import pytest

from perception.networks import inference_packages

WITH_TILES = "flags\t\t: fpu avx2 avx512_vnni amx_bf16 amx_tile amx_int8\n"


@pytest.mark.parametrize(
    ("info", "before", "after"),
    [
        (WITH_TILES, {}, {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE_FP16"}),
        # With a cap, a processor that has VNNI but no AVX-512 would lose it.
        ("flags\t\t: fpu avx2 avx_vnni\n", {}, {}),
        ("Features : asimd\n", {}, {}),
        (None, {}, {}),
        (WITH_TILES, {"ONEDNN_MAX_CPU_ISA": "AVX2"}, {"ONEDNN_MAX_CPU_ISA": "AVX2"}),
        (WITH_TILES, {"DNNL_MAX_CPU_ISA": "AVX2"}, {"DNNL_MAX_CPU_ISA": "AVX2"}),
    ],
)
def test_tile_instructions_are_left_out_where_they_are_announced(
    tmp_path: Path, info: str | None, before: dict[str, str], after: dict[str, str]
) -> None:
    path = tmp_path / "cpuinfo"
    if info is not None:
        path.write_text(info, encoding="utf-8")
    environment = dict(before)
    inference_packages._spare_amx(environment, path)
    assert environment == after
