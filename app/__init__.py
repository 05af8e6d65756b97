"""The debugger in the browser and the command line.

Computes nothing about fairing: it shows a Session and its Trace. `show`, `progress` and `measure` are for notebooks.
"""

import os

import lazy_loader

# Before numpy is imported. The engine has threads of its own; OpenBLAS's would get in their way: on two busy cores it took 85 ms
# to project 100,000 points, and 1 ms with one thread. The numbers are the same.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
