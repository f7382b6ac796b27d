"""Shared code of all networks: ONNX files, weights files and training."""
