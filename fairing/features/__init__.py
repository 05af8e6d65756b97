"""Feature points."""
