"""What commands that fly nothing import."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_leaves_can_be_known_without_numba() -> None:
    code = "import sys\nsys.modules['numba'] = None\nimport behaviours.nodes\n"
    code += "import behaviours.perceive.depth, behaviours.perceive.site_map"
    done = subprocess.run(  # noqa: S603 - our own interpreter and code
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_site_map_compiles_before_the_flight() -> None:
    code = "import sys\nimport perception.mapping.site_mapper\n"
    code += "assert 'perception.mapping.contact_scan' in sys.modules"
    done = subprocess.run(  # noqa: S603 - our own interpreter and code
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert done.returncode == 0, done.stderr
