"""The test kit: a mocked board, a clock moved by hand and a scripted drone."""
