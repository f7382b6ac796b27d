"""Flight records: MCAP files that the field's viewers open and that can be flown again.

`FlightRecorder` writes one while flying, `RecordReader` reads it, whole or damaged. Writing and
reading need the extra `record`; nothing is imported before it is asked for.
"""
