"""The loopback ANAFI: a simulated drone for unmodified clients of the real one."""
