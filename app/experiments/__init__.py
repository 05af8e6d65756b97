"""Experiments as users start them: worker processes, charts and files.

May import `fairing`, `app.files` and the loose modules of `app`; never viser.
"""
