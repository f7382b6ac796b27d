"""Simulated firmware of the ANAFI: turns commands into movements of the twin, and into events."""
