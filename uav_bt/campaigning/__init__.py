"""Campaigns, composed: what is flown with which files, and how a campaign goes.

Example:
    >>> from pathlib import Path
    >>> from uav_bt import campaigning
    >>> plan = campaigning.make_plan(["land_only"], scenes=["val-*"], flights=10)
    >>> campaigning.campaign(plan, Path("runs/land")).flights[0]["outcome"]
    'success'
"""

from uav_bt.campaigning.campaign import CampaignResult, campaign
from uav_bt.campaigning.planning import make_plan, plan_of

__all__ = ["CampaignResult", "campaign", "make_plan", "plan_of"]
