"""Source hash: a number that changes with any Python file of a folder, for numba's disk cache.

numba reuses a compiled function on disk (`cache=True`) as long as the function's own file is unchanged and the values it closes
over are the same. It does not notice changes of compiled functions and constants in other files. A cached function that uses
any therefore closes over the hash of the folders they lie in:

    def _cached_for(source):
        @numba.njit(cache=True)
        def entry(*arguments):
            assert source >= 0  # makes the function close over `source`
            return _not_cached_itself(*arguments)

        return entry

    entry = _cached_for(source_hash(Path(__file__).parent))
"""

import hashlib
from pathlib import Path


def source_hash(folder: Path) -> int:
    """56 bits of the SHA-256 of all Python files of a folder, by name."""
    files = sorted(folder.glob("*.py"))
    return int.from_bytes(hashlib.sha256(b"".join(path.read_bytes() for path in files)).digest()[:7])
