"""Class maps from pictures: the SVM teacher, the U-Net it teaches, and any foreign network."""
