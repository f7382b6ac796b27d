"""Parrot's ANAFI, flown through the Olympe SDK: a real one, or a simulated one of Sphinx.

The entry points register `AnafiConfig` and `SphinxConfig`. Only `sdk` imports Parrot's SDK, when a
drone connects.
"""

from sim_bridge.olympe.kinds import AnafiConfig, SphinxConfig

__all__ = ["AnafiConfig", "SphinxConfig"]
