"""Landing marks: a finder for each kind, and the track of the mark that is found."""
