"""What all networks share: running ONNX files, writing them, and keeping a training's state."""
