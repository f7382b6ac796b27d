"""The processor's instructions that inference leaves out."""

from pathlib import Path

from perception.networks import inference_packages

WITH_TILES = "flags\t\t: fpu avx2 avx512_vnni amx_bf16 amx_tile amx_int8\n"


def test_tile_instructions_are_left_out_where_they_are_announced(tmp_path: Path) -> None:
    path = tmp_path / "cpuinfo"
    for info, before, added in (
        (None, {}, {}),
        (WITH_TILES, {}, {"ONEDNN_MAX_CPU_ISA": "AVX512_CORE_FP16"}),
        # With a cap, a processor that has VNNI but no AVX-512 would lose it.
        ("flags\t\t: fpu avx2 avx_vnni\n", {}, {}),
        ("Features : asimd\n", {}, {}),
        (WITH_TILES, {"ONEDNN_MAX_CPU_ISA": "AVX2"}, {}),
        (WITH_TILES, {"DNNL_MAX_CPU_ISA": "AVX2"}, {}),
    ):
        if info is not None:
            path.write_text(info, encoding="utf-8")
        environment = dict(before)
        inference_packages._spare_amx(environment, path)
        assert environment == {**before, **added}
