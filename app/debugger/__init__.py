"""The debugger without a browser: the controller, its commands, runs, breakpoints, conditions and history.

May import `fairing` and the loose modules of `app`; never viser.
"""
