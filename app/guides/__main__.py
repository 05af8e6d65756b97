"""The guides and the API reference as one site: `python -m app.guides FOLDER`, then open FOLDER/index.html."""

import importlib.util
import sys
from pathlib import Path

from fairing.errors import InputError


def main(arguments: list[str]) -> int:
    """Write the site; returns the exit code."""
    if len(arguments) != 1 or arguments[0].startswith("-"):
        sys.stderr.write(f"{__doc__}\n")
        return 2
    if importlib.util.find_spec("pdoc") is None:
        sys.stderr.write('eigenfairing: the site needs pdoc; install it with: pip install "eigenfairing[docs]"\n')
        return 1
    from app.guides.site import write_site

    try:
        write_site(Path(arguments[0]))
    except InputError as error:
        sys.stderr.write(f"eigenfairing: {error}\n")
        return 1
    sys.stdout.write(f"wrote {Path(arguments[0]) / 'index.html'}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
