"""Soak test: `python -m tests.soak --minutes 120` uses several pages at random and measures the server's process.

Pages in headless Chromium open, reload, step, run, scrub, branch, play and select on the demo cube. The server runs in a process
of its own, so that the memory of the browser's driver does not count. Its memory, threads and file descriptors are printed every
minute; Ctrl-C ends the test early.

The exit code is 0 if, after the warm-up, memory grew by less than 5 % an hour, threads and descriptors did not grow, and no page
logged an error. During the warm-up, caches of a fixed size are filled: textures, compiled code, thread pools, four runs of 400
steps.
"""
