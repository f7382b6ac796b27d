"""`uav-bt calibrate`: the camera's intrinsics from photographs of a checkerboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from uav_bt.cli.options import output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.errors import FileError
from uav_bt.files import reading

if TYPE_CHECKING:
    from perception.camera.calibration import Calibration

__all__ = ["calibrate"]

_PICTURES: Final = {".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".webp"}


@click.command()
@click.argument(
    "images", metavar="IMAGES...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@click.option(
    "--square-mm",
    type=click.FloatRange(min=0.0, min_open=True),
    default=20.0,
    show_default=True,
    help="Edge of one square of the board.",
)
@output_option("--out", "The camera file; camera.yaml if not given.")
def calibrate(*, images: tuple[Path, ...], square_mm: float, out: Path | None) -> None:
    """Calibrate a camera from photographs of a checkerboard.

    IMAGES are pictures or folders of pictures. The board's layout need not be known: every layout
    of inner corners that the pictures allow is tried, and the camera with the lowest reprojection
    error is kept. What cannot be used is named.
    """
    from perception.camera import calibration  # noqa: PLC0415
    from perception.camera.camera_file import write_camera  # noqa: PLC0415

    photographs = {str(path): _reader(path) for path in _pictures(images)}
    config = calibration.CalibrationConfig(square_m=square_mm / 1000.0)
    with progress_bars() as advance:
        found = calibration.calibrate(photographs, config, advance=advance)
    _show(found)
    file = Path("camera.yaml") if out is None else out
    write_camera(file, found.best)
    click.echo(f"camera file: {file}")


def _pictures(paths: tuple[Path, ...]) -> list[Path]:
    """Return all pictures of files and folders, each once.

    Raises:
        FileError: a path is absent, or a folder holds no picture.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = [file for file in sorted(path.iterdir()) if file.suffix.lower() in _PICTURES]
            if not inside:
                raise FileError(path, f"the folder holds no pictures ({', '.join(_PICTURES)})")
            found.update(dict.fromkeys(inside))
        elif path.is_file():
            found[path] = None
        else:
            raise FileError(path, "there is no such picture")
    return list(found)


def _reader(path: Path) -> Callable[[], Any]:
    def read() -> Any:
        import cv2  # noqa: PLC0415 - late, for --help
        import numpy as np  # noqa: PLC0415

        with reading(path):
            encoded = np.fromfile(path, dtype=np.uint8)
        picture = cv2.imdecode(encoded, cv2.IMREAD_GRAYSCALE) if encoded.size else None
        if picture is None:
            raise FileError(path, "is not a readable picture")
        return picture

    return read


def _show(found: Calibration) -> None:
    click.echo("layout    images  error, px  error of all corners, px")
    for trial in found.trials:
        kept = "  <- kept" if trial is found.best else ""
        layout = f"{trial.columns}x{trial.rows}"
        click.echo(
            f"{layout:<8}  {len(trial.images):6d}  {trial.error_px:9.3f}  "
            f"{trial.common_error_px:9.3f}{kept}"
        )
    camera = found.best.camera
    click.echo(
        f"{camera.width_px}x{camera.height_px}: focal lengths {camera.fx_px:.2f}, "
        f"{camera.fy_px:.2f} px; centre {camera.cx_px:.2f}, {camera.cy_px:.2f} px; distortion "
        + " ".join(f"{value:.4f}" for value in camera.distortion)
    )
    for name, reason in found.skipped.items():
        click.echo(f"skipped {name}: {reason}")
