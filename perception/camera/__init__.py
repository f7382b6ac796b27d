"""The camera: calibration, camera files, geometry of the image and of the ground plane."""
