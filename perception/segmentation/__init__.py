"""Class maps from images: the SVM teacher, the U-Net trained by it, and foreign networks."""
