"""Sources of images: videos, folders, flight records and live cameras."""
