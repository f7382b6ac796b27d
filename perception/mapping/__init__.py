"""The site map: ground, obstacles, movers and landing mark of the place, and the drone's pose."""
