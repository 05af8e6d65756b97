"""The debugger in the browser and the command line.

Computes nothing about fairing: it shows a Session and its Trace. `show`, `progress` and `measure` are for notebooks.
"""

import os
from typing import TYPE_CHECKING

from fairing.util.on_demand import on_demand

if TYPE_CHECKING:
    from app.notebook.measuring import measure
    from app.notebook.progress import progress
    from app.notebook.show import show

__all__ = ["measure", "progress", "show"]

# Before numpy is imported. The engine has threads of its own; OpenBLAS's would get in their way: on two busy cores it took 85 ms
# to project 100,000 points, and 1 ms with one thread. The numbers are the same.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

__getattr__ = on_demand(
    __name__,
    {
        "measure": "app.notebook.measuring",
        "progress": "app.notebook.progress",
        "show": "app.notebook.show",
    },
)
