"""`docs`: the guides and the API reference as one site."""

import importlib.util
from pathlib import Path

from rich.console import Console

from app.cli.lines import print_line
from fairing.errors import InputError


def docs(out: Path) -> int:
    """Write the guides and the API reference as one site with a search.

    Needs `pip install "eigenfairing[docs]"`.

    Args:
        out: Folder for the site: new, empty, or of an earlier call. Its pages need no server: open index.html.
    """
    if importlib.util.find_spec("pdoc") is None:
        raise InputError('docs: expected pdoc, found none; install it with: pip install "eigenfairing[docs]"')
    from app.guides.site import write_site

    write_site(out)
    print_line(Console(stderr=True), f"wrote {out / 'index.html'}")
    return 0
