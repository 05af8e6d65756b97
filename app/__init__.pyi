from .notebook.measuring import measure as measure
from .notebook.progress import progress as progress
from .notebook.show import show as show
