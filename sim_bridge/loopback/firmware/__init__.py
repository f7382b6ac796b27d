"""What the ANAFI's own software does: commands in, a body's movements and events out.

Every part takes the time with its calls, and moves a `World`; nothing here knows sockets.
"""
