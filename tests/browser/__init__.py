"""Help for tests that drive the page in Chromium."""
