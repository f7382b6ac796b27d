"""The landing mark: detection and tracking."""
