"""Many flights: planned, flown in separate processes, kept line by line, resumed, reported.

Example:
    >>> from pathlib import Path
    >>> from uav_bt import campaign
    >>> plan = campaign.make_plan(["land_only"], scenes=["val-*"], flights=10)
    >>> campaign.run(plan, Path("runs/land")).flights[0]["outcome"]
    'success'
    >>> from uav_bt.campaign.report.campaign_report import write_report  # needs matplotlib
    >>> write_report([Path("runs/land")]).page
    PosixPath('runs/land/report.html')
"""

from uav_bt.campaign.planning import make_plan, plan_of
from uav_bt.campaign.runner import CampaignResult, run

__all__ = ["CampaignResult", "make_plan", "plan_of", "run"]
