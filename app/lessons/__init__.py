"""Lessons: texts that drive the engine and the page, step by step, and claim nothing that the engine does not show.

A lesson is a file in `texts/` (see `reader`). The player (`player`) posts the same commands as everybody and knows
nothing of the browser.
"""
