"""Perception of a video, a folder of images or a live camera: what `uav-bt net perceive` does.

summary = perceiving.perceive("flight.mp4", out=Path("seen.mp4"))
"""

from uav_bt.app.perceive.inputs import Look, PerceiveOptions
from uav_bt.app.perceive.outputs import PerceiveSummary
from uav_bt.app.perceive.run import perceive

__all__ = ["Look", "PerceiveOptions", "PerceiveSummary", "perceive"]
