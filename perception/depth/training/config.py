"""How the depth network is trained; importing this needs no torch."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final, Literal

from perception.depth.training.clips import ClipConfig
from uav_bt.errors import UnknownNameError, ValueRangeError

__all__ = ["DepthTrainingConfig"]

_POSES: Final = ("telemetry", "network")


@dataclass(frozen=True, kw_only=True)
class DepthTrainingConfig:
    """How the depth network is trained. The weights of the terms are SC-Depth's."""

    steps: int = 2500
    batch: int = 4  # clips a step, of three frames each
    learning_rate: float = 1e-3  # peak; AdamW. SC-Depth's 1e-4 starts from a trained encoder
    weight_decay: float = 1e-4
    warm_up_steps: int = 100  # linear rise, then half a cosine down to nothing
    pose: Literal["telemetry", "network"] = "telemetry"  # where the camera's movement comes from
    photometric: float = 1.0  # weight; nought, with geometry, learns from labels alone
    geometry: float = 0.1  # weight
    smoothness: float = 0.1  # weight
    labels: float = 1.0  # weight, where the flights come with labels
    average: float = 0.99  # decay of the running mean of the weights, which is what is kept
    clips: ClipConfig = field(default_factory=ClipConfig)
    seed: int = 0  # of the first weights, the order of the clips and their changes
    checkpoint_every: int = 100  # steps

    def __post_init__(self) -> None:
        if min(self.steps, self.batch, self.checkpoint_every) < 1 or self.learning_rate <= 0.0:
            raise ValueRangeError(
                "steps, batch, checkpoint_every and learning_rate must be positive, got "
                f"{self.steps}, {self.batch}, {self.checkpoint_every}, {self.learning_rate}"
            )
        weights = (self.photometric, self.geometry, self.smoothness, self.labels)
        if min(weights) < 0.0 or not any(weights):
            raise ValueRangeError(f"weights must not be negative nor all nought, got {weights}")
        if not 0.0 <= self.average < 1.0:
            raise ValueRangeError(f"average must lie within 0 and 1, got {self.average}")
        if self.pose not in _POSES:
            raise UnknownNameError("source of the pose", self.pose, _POSES)

    @property
    def compares_frames(self) -> bool:
        """Whether neighbouring frames teach."""
        return self.photometric > 0.0 or self.geometry > 0.0
