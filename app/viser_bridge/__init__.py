"""Everything that works around or extends viser."""
