"""Campaigns, composed: what is flown with which files, how it goes, what came of it.

Example:
    >>> from pathlib import Path
    >>> from uav_bt import campaigning
    >>> plan = campaigning.make_plan(["land_only"], scenes=["val-*"], flights=10)
    >>> campaigning.campaign(plan, Path("runs/land")).flights[0]["outcome"]
    'success'
    >>> campaigning.report([Path("runs/land")]).page
    PosixPath('runs/land/report.html')
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from uav_bt.campaigning.campaign import CampaignResult, campaign
from uav_bt.campaigning.planning import make_plan, plan_of

if TYPE_CHECKING:
    from uav_bt.campaigning.reporting import report

__all__ = ["CampaignResult", "campaign", "make_plan", "plan_of", "report"]


def __getattr__(name: str) -> Any:
    """Import what draws when somebody asks for it: campaigns fly without matplotlib."""
    if name == "report":
        from uav_bt.campaigning.reporting import report  # noqa: PLC0415

        return report
    raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
