"""`python -m uav_bt`: the command line where the `uav-bt` script is not on the path."""

from uav_bt.cli import main

main()
