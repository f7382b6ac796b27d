"""Parrot's ANAFI, flown through the Olympe SDK: a real one, or a simulated one of Sphinx.

`AnafiConfig` and `SphinxConfig` are what the entry points register. Nothing of the SDK is imported
before a drone connects, and only `sdk` imports it.
"""

from sim_bridge.olympe.kinds import AnafiConfig, SphinxConfig

__all__ = ["AnafiConfig", "SphinxConfig"]
