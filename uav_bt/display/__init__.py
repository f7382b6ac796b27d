"""What a person watches: status line, lab map, films, Rerun."""
