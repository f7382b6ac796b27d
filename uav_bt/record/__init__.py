"""Flight records: MCAP files that common viewers open and that can be replayed.

`FlightRecorder` writes one in flight. `RecordReader` reads it, whole or damaged. Both need the
extra `record`, which is imported on first use.
"""
