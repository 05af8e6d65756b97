"""Experiments as users start them: in processes of their own, as charts, as files."""
