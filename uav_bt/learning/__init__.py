"""Training data, training, evaluation and export of the networks of `perception`."""
