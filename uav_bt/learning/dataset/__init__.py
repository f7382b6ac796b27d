"""Records as training sets: flights, an index of each, windows over time, torch data sets."""
