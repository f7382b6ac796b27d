"""LearnGround: learn in flight which pixels of an unknown place are ground."""

from __future__ import annotations

from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Final

from behaviours.fly.sway_around import SwayAround
from perception.networks.named import ANY, SHIPPED_UNET, segmentation_file
from uav_bt.board import CAMERA, FRAME, PHASE, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import UavBtError, UnknownNameError
from uav_bt.lab.lab import check_lab_name
from uav_bt.lab.shipped import load_lab
from uav_bt.tree import Port, Status
from uav_bt.types import Hover
from uav_bt.types.flight_results import EventKind

if TYPE_CHECKING:
    from perception.odometry.flown_footage import FootageBuilder
    from perception.segmentation.adaptation.learned_lab import LearnedPlace

_FOOTAGE_PX: Final = (448, 224)  # twice the size of the labels


def _network_file(model: str) -> Path:
    path = segmentation_file(model)
    if path is None:
        raise UnknownNameError("network to adapt", model, (ANY, SHIPPED_UNET, "FILE.onnx"))
    return path


def _lab_name(name: str) -> None:
    if name:
        check_lab_name(name)


class LearnGround(SwayAround):
    """Learn which pixels are ground from the motion between frames; SUCCESS when it is learned.

    The drone turns once around as with `SwayAround`, which this leaf contains. Then it hovers for
    `compute_s`, while a thread labels the frames by geometry and fits a linear head on the features
    of a frozen network. After that `Segment` uses the result. FAILURE when the flight shows too
    little, for example without texture on the ground. With `lab` the result is also written as a
    lab folder of that name into the flight's output folder.
    """

    answers = (Status.SUCCESS, Status.FAILURE, Status.RUNNING)
    budget_s = 120.0  # simulated time stands still while the leaf waits for its thread
    ports = (
        *SwayAround.ports,
        Port(
            "model",
            str,
            default=ANY,
            doc="network to adapt: 'any', 'unet', or an ONNX file with roles and features",
            look_up=_network_file,
            at_setup=True,
        ),
        Port(
            "compute_s",
            float,
            default=20.0,
            least=0,
            most=600,
            doc="time of hovering until the result is used, s; a real drone hovers on if need be",
        ),
        Port(
            "lab",
            str,
            default="",
            doc="name of the lab folder to write, with the package onnx; empty: none",
            look_up=_lab_name,
            at_setup=True,
        ),
    )
    reads = (STATE, FRAME, CAMERA)
    writes = (PHASE,)

    def on_setup(self, mission: MissionContext) -> None:
        """Load the network.

        Raises:
            WeightsError: it cannot be adapted.
            MissingDependencyError: a lab is to be written, and the package onnx is not installed.
        """
        # Late: an inference runtime takes seconds to import; `uav-bt check` must answer at once.
        from perception.networks.inference_packages import import_onnx  # noqa: PLC0415
        from perception.segmentation.adaptation.role_network import OnnxRoleNetwork  # noqa: PLC0415

        super().on_setup(mission)
        self._context = mission
        _lab_name(self.port_value("lab"))
        if self.port_value("lab") and mission.outputs is not None:
            import_onnx()
        model = self.port_value("model")
        path = _network_file(model)
        # A network states its classes by name, and the shipped ones have those of the paper's lab.
        classes = load_lab().classes if model == SHIPPED_UNET else mission.classes
        self._network = OnnxRoleNetwork(path, classes, threads=mission.inference_threads)
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="learn")

    def on_shutdown(self) -> None:
        """End the thread."""
        self._worker.shutdown(wait=True, cancel_futures=True)

    def initialise(self) -> None:
        """Begin with the turn, and with no frames."""
        super().initialise()
        self._gathered: FootageBuilder | None = None
        self._result: Future[LearnedPlace] | None = None
        self._asked_s = 0.0

    def update(self) -> Status:
        """Gather frames during the turn, then wait for the result."""
        if self._context.sight is not None:
            self.feedback_message = "a drone without images cannot learn what ground looks like"
            return Status.FAILURE
        if self._result is not None:
            return self._wait(self._result)
        self._gather()
        if super().update() is Status.RUNNING:
            return Status.RUNNING
        if self._gathered is None or not len(self._gathered):
            self.feedback_message = "no frame has arrived"
            return Status.FAILURE
        self._asked_s = self._leaf_clock.now()
        self._result = self._worker.submit(self._learn, self._gathered)
        self._gathered = None
        return self._wait(self._result)

    def _gather(self) -> None:
        from perception.odometry.flown_footage import FootageBuilder  # noqa: PLC0415 - OpenCV

        state, frame = self.read(STATE).value, self.read(FRAME).value
        camera = self.read(CAMERA).value
        if camera is None:
            return
        if self._gathered is None:
            self._gathered = FootageBuilder(camera, _FOOTAGE_PX)
        if state is not None:
            self._gathered.add_state(state)
        if frame is not None:
            self._gathered.add_frame(frame)

    def _learn(self, gathered: FootageBuilder) -> LearnedPlace:
        """Label and fit; in the thread."""
        from perception.segmentation.adaptation.learned_lab import (  # noqa: PLC0415 - scikit-learn
            learn_place,
            network_hash,
        )

        base = network_hash(self._network.path)
        made = datetime.now(UTC).isoformat(timespec="seconds") if self._context.live else ""
        return learn_place(gathered.footage(), self._network, base=base, made=made)

    def _wait(self, result: Future[LearnedPlace]) -> Status:
        self._leaf_clock.tick()
        early = self._leaf_clock.now() - self._asked_s < self.port_value("compute_s") - 1e-6
        if early or (self._context.live and not result.done()):
            self.propose(Hover())
            return Status.RUNNING
        try:
            place = result.result()
            self._use(place)
        except UavBtError as error:
            self.feedback_message = str(error)
            return Status.FAILURE
        return Status.SUCCESS

    def _use(self, place: LearnedPlace) -> None:
        from perception.segmentation.adaptation.learned_lab import AdaptedSegmenter  # noqa: PLC0415 - as above

        mission, statement = self._context, place.statement
        mission.learned.segmenter = AdaptedSegmenter(self._network, place.head, mission.classes)
        mission.learned.replaced += 1
        text = (
            f"learned the ground from {statement.frames} frames: {statement.known_share:.0%} of "
            f"their pixels have a label, the network gives {statement.agreement:.0%} of the labels"
        )
        if not place.head.is_new:
            text += "; no head does better on frames that it was not fitted to, so it is kept"
        mission.add_event(EventKind.INFO, text, self.path)
        if self.port_value("lab"):
            self._write(place, self.port_value("lab"))

    def _write(self, place: LearnedPlace, name: str) -> None:
        """Write the lab folder; the flight goes on if that fails."""
        from perception.segmentation.adaptation.learned_lab import write_learned_lab  # noqa: PLC0415 - as above

        mission = self._context
        if mission.outputs is None:
            text = f"the lab '{name}' is not written: the flight has no output folder (--out)"
            mission.add_event(EventKind.WARNING, text, self.path)
            return
        try:
            mission.outputs.make()
            lab = write_learned_lab(mission.outputs.folder / name, place, self._network)
        except UavBtError as error:
            text = f"the lab '{name}' is not written: {error}"
            mission.add_event(EventKind.WARNING, text, self.path)
            return
        mission.add_event(EventKind.INFO, f"the lab is in {lab.folder}", self.path)
