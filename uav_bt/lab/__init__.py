"""Labs: places to fly in, as values and files.

Modules are imported by name, because reading a file needs pydantic and classes do not.
"""
