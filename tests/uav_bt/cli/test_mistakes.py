"""Mistakes at the command line: each gets its message and changes no file."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.worlds.cli import HOP, run, tree_file

MISTAKES = [
    # --- names
    ("fligh land_only", "there is no command 'fligh'; did you mean 'fly'"),
    ("flight land_only", "there is no command 'flight'; did you mean 'fly'"),
    ("start", "there is no command 'start' $"),
    ("train student", "'train' is 'uav-bt net train'"),
    ("net evaluate detph", "did you mean 'depth'"),
    ("net scenes", "there is no command 'scenes'; 'scenes' is 'uav-bt lab scenes'"),
    ("student", "'student' is 'uav-bt net train student' or 'uav-bt net evaluate student'"),
    ("fly", "Missing argument 'TREE'"),
    ("fly land_onyl", "no such tree file.*did you mean 'land_only'"),
    ("fly ./nowhere/land_only.xml", "no such tree file"),
    ("fly mission.xml --scene vla-a", "unknown scene 'vla-a'; did you mean 'val-a'"),
    ("fly mission.xml --drone anafi:a:b", "expected HOST or HOST:DISCOVERY_PORT"),
    ("fly mission.xml --drone twim", "unknown drone 'twim'; did you mean 'twin'"),
    ("fly mission.xml --policy Nobody=corridor", "no node of that name"),
    ("fly land_only --policy ReturnToBse=segmentation", "did you mean 'ReturnToBase'"),
    ("fly mission.xml --policy TakeOff=segmentation", "TakeOff.*policy"),
    ("fly mission.xml --sene val-a", "No such option.*--sene.*(--scene|mean)"),
    ("fly mission.xml extra", "unexpected extra argument"),
    ("campaign mission.xml --scenes vla-* --out out", "vla-"),
    ("campaign", "which TREE"),
    ("campaign mission.xml mission.xml --out out", "two trees are called 'mission.xml'"),
    ("replay record.mcap --tree land_onyl", "record.mcap|did you mean"),
    ("tree nodes Landd", "unknown node 'Landd'; did you mean 'Land'"),
    ("new mine.xml --from hoover", "hoover.*is not one of"),
    ("lab scenes --show vla-a", "unknown scene 'vla-a'; did you mean 'val-a'"),
    ("net evaluate depth --model dpth", "unknown depth model 'dpth'; did you mean 'depth'"),
    ("net evaluate depth --model contact --scene test-c", "unknown scene 'test-c'"),
    ("net evaluate depth --masks teacher", "--masks"),
    ("net perceive photos --segmentation unett", "unknown segmentation model 'unett'"),
    ("net train depth old.mcap --pose none", "'none' is not one of"),
    ("net collect land_only --profile harshh", "'harshh' is not one of"),
    ("serve-anafi --scene vla-a", "unknown scene 'vla-a'; did you mean 'val-a'"),
    ("serve-anafi --profile labb", "unknown profile 'labb'"),
    ("doctor --drone twim", "unknown drone 'twim'; did you mean 'twin'"),
    # --- numbers
    ("fly mission.xml --seed -1", "-1 is not in the range x>=0"),
    ("fly mission.xml --threads 0", "0 is not in the range x>=1"),
    ("fly mission.xml --image-size 640", "expected a size such as 640x360, got '640'"),
    ("fly mission.xml --image-size 640x480", "16:9"),
    ("fly mission.xml --groot 99999", "99999 is not in the range 1<=x<=65534"),
    ("campaign mission.xml --flights 0 --out out", "0 is not in the range x>=1"),
    ("campaign mission.xml --timeout-s 0 --out out", "0.0 is not in the range x>0"),
    ("campaign mission.xml --timeout-s nan --out out", "'nan' is not a finite number"),
    ("campaign mission.xml --fail-under 101 --out out", "101.0 is not in the range 0<=x<=100"),
    ("campaign mission.xml --workers -2 --out out", "-2 is not in the range x>=1"),
    ("simulate mission.xml --script script.yaml --ticks 0", "0 is not in the range x>=1"),
    ("simulate mission.xml --script script.yaml --tick-s inf", "inf is not in the range 0<x<=3600"),
    ("view record.mcap --save x.rrd --from 5 --to 2", "--from 5 must lie before --to 2"),
    ("net perceive photos --masks photos", "photos: has files, and net perceive --masks writes to"),
    ("net perceive photos --height-m -1", "-1.0 is not in the range 0<x<=100"),
    ("net perceive photos --gimbal-deg 91", "91.0 is not in the range -90<=x<=90"),
    ("net perceive photos --seconds 0", "0.0 is not in the range x>0"),
    ("lab pick paper --port 70000", "70000 is not in the range 0<=x<=65535"),
    ("net train student record.mcap --views 9", "9 is not in the range 1<=x<=5"),
    ("net evaluate depth --views 0", "0 is not in the range x>=1"),
    ("lab calibrate photos --square-mm 0", "0.0 is not in the range x>0"),
    ("serve-anafi --battery 101", "101 is not in the range 0<=x<=100"),
    ("serve-anafi --rate 0", "0.0 is not in the range 0.1<=x<=240"),
    # --- files that are missing, empty, something else, or a folder
    ("fly mission.xml --site broken.yaml", "broken.yaml:1"),
    ("fly mission.xml --site keys.yaml", "flight_hight_m: unknown key; did you mean"),
    ("fly mission.xml --site margins.yaml", "margins.yaml:1: margins.obstacle_m: .* 0.30 m"),
    ("fly mission.xml --lab paprr", "unknown lab 'paprr'; did you mean 'paper'"),
    ("fly mission.xml --lab ./absent", "absent: there is no such lab file"),
    ("fly mission.xml --lab paper --site empty.yaml", "--lab and --site .* both say how"),
    ("fly mission.xml --lab ./keys.yaml", "keys.yaml:1: .*lacks the key 'version'"),
    ("check mission.xml unknown.xml --lab paper", "--lab are for one mission"),
    ("fly photos", "photos"),
    ("fly unclosed.xml", "unclosed.xml:2:"),
    ("check absent.xml", "no such tree file"),
    ("check photos", "no tree file"),
    ("check unknown.xml", "unknown node 'Lnd'; did you mean 'Land'"),
    ("simulate mission.xml", "Missing option '--script'"),
    ("simulate mission.xml --script keys.yaml", "keys.yaml:1"),
    ("report absent", "absent"),
    ("view record.mcap --save x.rrd", "record.mcap"),
    ("view photos --save x.rrd", "'photos' is a directory"),
    ("record info mission.xml", "mission.xml"),
    ("campaign --resume photos", "photos"),
    ("lab scenes --show broken.yaml", "broken.yaml"),
    # --- names of files beside the missing one
    ("fly misson.xml", "misson.xml: no such tree file.*; did you mean 'mission.xml'"),
    ("fly mission.xml --scene brokn.yaml", "no such scene file; did you mean 'broken.yaml'"),
    ("fly mission.xml --site brokn.yaml", "no such site file; did you mean 'broken.yaml'"),
    ("replay recrd.mcap", "recrd.mcap: no such file; did you mean 'record.mcap'"),
    ("net perceive photo", "there is no such video file or folder.*; did you mean 'photos'"),
    # --- a YAML file where a tree file is expected
    ("fly keys.yaml", "keys.yaml: expected a tree file.*got a YAML file.*scenes --show keys.yaml"),
    ("lab calibrate photos", "at least 3 photographs"),
    ("lab calibrate empty", "the folder holds no images"),
    ("lab frames paper photo", "there is no such video.*; did you mean 'photos'"),
    ("lab frames paper binary.bin", "binary.bin: is not a readable video"),
    ("lab frames paper empty", "empty: the folder holds no video"),
    ("lab frames paper photos --count 0", "0 is not in the range x>=1"),
    ("lab tune-heading binary.bin", "binary.bin"),
    ("net perceive binary.bin", "is not a readable video"),
    ("net perceive empty", "no images"),
    ("net perceive camera:x", "expected a camera such as camera:0, got 'camera:x'"),
    ("net perceive camera:99", "camera 99 does not open"),
    ("net perceive photos --classes keys.yaml", "belongs to an ONNX segmentation network"),
    ("net perceive photos --model weights.safetensors", "the weights of a training"),
    ("lab pick paprr", "unknown lab 'paprr'; did you mean 'paper'"),
    ("lab pick paper", "there are no images of 'paper': `uav-bt lab frames`"),
    ("lab check absent", "unknown lab 'absent'"),
    ("lab check paper --flight binary.bin", "binary.bin"),
    ("net train depth binary.bin", "binary.bin"),
    ("net train student photos", "photos"),
    ("net evaluate depth --model binary.bin", "is not a readable ONNX network"),
    ("net evaluate student record.mcap --model absent.onnx", "there is no such network"),
    ("net export depth --weights binary.bin", "binary.bin"),
    ("net collect explore_and_land_advised --student absent.onnx --out out", "absent.onnx"),
    # --- outputs
    ("new mine.txt", "ends in .xml"),
    ("new nowhere/mine.xml", "nowhere/mine.xml"),
    ("fly mission.xml --video film.avi", "must end in .mp4"),
    ("fly mission.xml --record flight.bag", "must end in .mcap"),
    ("fly mission.xml --btlog flight.log", "must end in .btlog"),
    ("net train depth record.mcap --out depth.pt", "must end in .safetensors"),
    ("net export depth --out depth.pt", "must end in .onnx"),
    ("view record.mcap --save view.mp4", "must end in .rrd"),
    ("lab scenes --show train-a --out map.jpg", "must end in .png"),
    ("lab schema --out schema.yaml", "must end in .json"),
    ("report flights.jsonl --out flights.jsonl", "must end in .html"),
    # --- combinations
    ("lab scenes --out map.png", "--out needs --show SCENE"),
    ("campaign mission.xml --backend dask --out out", "--backend dask and --address"),
    ("campaign mission.xml --resume out --flights 3", "leave out TREE, --flights"),
    (
        "campaign mission.xml --backend dask --address x:1 --workers 2 --out out",
        "--workers is for this machine",
    ),
    ("check mission.xml --ros-pkg robot", "expected NAME=DIR"),
    ("net train depth record.mcap --no-photometric --labels none", "nothing to learn from"),
    ("fly mission.xml --policy A=x --policy A=y", "'A' is given two values"),
    ("fly mission.xml --policy Land", "expected NODE=NAME"),
    ("fly mission.xml --drone twin:1.2.3.4 --view windw", "windw"),
    ("net collect land_only --out out", "Advise"),
]
"""The arguments of `uav-bt`, and a pattern of the message."""


@pytest.fixture
def world(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    tree_file(tmp_path, HOP)
    tree_file(tmp_path, "<Sequence><TakeOff/><Lnd/></Sequence>", "unknown.xml")
    (tmp_path / "unclosed.xml").write_text('<root BTCPP_format="4">\n<BehaviorTree ID="x"')
    for name in ("empty.xml", "empty.yaml", "empty.jsonl", "empty.mcap"):
        (tmp_path / name).touch()
    for name in ("binary.bin", "binary.xml", "record.mcap"):
        (tmp_path / name).write_bytes(b"\x7fELF" + bytes(range(255, -1, -1)) * 40)
    (tmp_path / "photos").mkdir()
    cv2.imwrite(str(tmp_path / "photos" / "a.png"), np.full((36, 64, 3), 90, dtype=np.uint8))
    (tmp_path / "empty").mkdir()
    (tmp_path / "broken.yaml").write_text("boxes: [")
    (tmp_path / "keys.yaml").write_text("flight_hight_m: 1.2\n")
    (tmp_path / "margins.yaml").write_text("margins: {obstacle_m: 0.25}\n")
    (tmp_path / "script.yaml").write_text("default: S\n")
    (tmp_path / "picks.csv").write_text("image,x,y,class\n")
    (tmp_path / "weights.safetensors").write_bytes(b"\x02\0\0\0\0\0\0\0{}")
    return tmp_path


def contents(folder: Path) -> dict[str, bytes | None]:
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
        if path.name != "__pycache__"
    }


@pytest.mark.parametrize(("line", "answer"), MISTAKES, ids=[line for line, _ in MISTAKES])
def test_a_mistake_is_answered_and_costs_no_file(line: str, answer: str, world: Path) -> None:
    before = contents(world)
    result = run(*line.split())
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    assert "unexpected" not in result.stderr.replace("unexpected extra", "")
    assert re.search(answer, re.sub(r"\s*\n\s*", " ", result.stderr)), result.stderr
    assert contents(world) == before


def test_mistakes_in_several_files_are_all_answered(world: Path) -> None:
    result = run(
        "check", "mission.xml", "unknown.xml", "empty.xml", "absent.xml", "--format", "json"
    )
    assert result.exit_code == 2
    answers = [json.loads(line) for line in result.stdout.splitlines()]
    assert [answer["ok"] for answer in answers] == [True, False, False, False]
