"""Training of the control student: windows of flights in, weights out."""
