"""The loopback ANAFI: a drone made of software that clients of the real one can fly."""
