"""Class maps from images: the SVM teacher, the U-Net it teaches, and any foreign network."""
