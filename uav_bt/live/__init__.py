"""Trees watched while they fly: Groot2's live protocol and its log files."""
