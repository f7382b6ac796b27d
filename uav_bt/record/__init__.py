"""Flight records: MCAP files that common viewers open and that can be replayed.

`FlightRecorder` writes one in flight. `RecordReader` reads it, whole or damaged. Both need the
extra `record`, which is imported on first use.
"""

from typing import Literal

Quality = Literal["lossless", "high", "small"]
"""Of camera images; only lossless ones replay exactly. A small record has images 320 pixels wide
and no maps, for networks with a smaller input."""
