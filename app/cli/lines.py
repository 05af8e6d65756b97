"""Lines on the terminal, printed as they are: no highlighting, no wrapping, no markup."""

from rich.console import Console


def print_line(console: Console, line: str) -> None:
    """Print a line. Brackets in names of files are not read as markup."""
    console.print(line, highlight=False, soft_wrap=True, markup=False)
