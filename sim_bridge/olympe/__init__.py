"""Bridge to Parrot's ANAFI through the Olympe SDK: a real drone, or one simulated by Sphinx.

The entry points register `AnafiConfig` and `SphinxConfig`. Only `sdk` imports Parrot's SDK, when a
drone connects.
"""

from sim_bridge.olympe.config import AnafiConfig, SphinxConfig

__all__ = ["AnafiConfig", "SphinxConfig"]
