"""The API reference, from the docstrings: `python -m tests.api_reference [FOLDER]`, then open FOLDER/index.html."""

import importlib
import sys
from pathlib import Path

import pdoc
import pdoc.render

MODULES = (
    "fairing", "fairing.options", "fairing.run.session", "fairing.trace", "fairing.judge.inspect", "fairing.judge.flow",
    "fairing.judge.certainty", "fairing.judge.metrics", "fairing.judge.report",
    "fairing.io", "fairing.texture", "fairing.triangulation",
    "fairing.registration.alignment", "fairing.experiments", "fairing.judge.cramer_rao", "demo_scenes",
)  # fmt: skip


def write_reference(folder: Path) -> None:
    """One page a module."""
    for name in MODULES:
        module = importlib.import_module(name)
        # Some packages import their rooms when these are asked for; the generator looks without asking.
        for member in getattr(module, "__all__", ()):
            setattr(module, member, getattr(module, member))
    pdoc.render.configure(docformat="google", show_source=False, footer_text="EigenFairing")
    pdoc.pdoc(*MODULES, output_directory=folder)


if __name__ == "__main__":
    write_reference(Path(sys.argv[1] if len(sys.argv) > 1 else "api"))
