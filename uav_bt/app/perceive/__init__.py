"""Perception of a video, a folder of images or a live camera, for `uav-bt net perceive`.

summary = perceive("flight.mp4", out=Path("seen.mp4"))
"""

from uav_bt.app.perceive.inputs import PerceiveOptions
from uav_bt.app.perceive.run import PerceiveSummary, perceive

__all__ = ["PerceiveOptions", "PerceiveSummary", "perceive"]
