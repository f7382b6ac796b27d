"""The control student: one small network from pixels to the next movement."""
