"""Imported ahead of the rest: an import from a foreign folder of a package's name would fail later.

Python puts a script's folder first, and `perception/` beside it hides ours.
"""

from uav_bt.plugins import check_packages

check_packages()
