"""The ANAFI's firmware: commands in, movements of a body and events out.

Every part gets the time with its calls and moves a `World`; nothing here knows sockets.
"""
