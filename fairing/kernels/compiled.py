"""How the kernels are compiled, and kept on disk.

What makes the loops fast, found by measuring:
- `error_model="numpy"`: Python's check for division by zero is a branch, and a loop with a branch does not vectorise
  (coordinates 0.21 ns a sample against 2, robust weights 0.12 against 1.2).
- Loops run over `range(n)` of slices, which spares the test for negative indices.

Cells are float32; sums over pairs of cells, energies and normal equations are collected in float64.
"""

import hashlib
from pathlib import Path

from numba import njit, types
from numba.extending import intrinsic

# Reassociation lets sums vectorise; the code that results is fixed, so runs repeat to the bit on one kind of processor.
_FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}

plain = njit(nogil=True, error_model="numpy")
fast = njit(nogil=True, error_model="numpy", fastmath=_FAST)
# For what sums nothing up. A function is optimised once more where it is linked to another: reassociated again, the cubic
# sampler rounded differently in `show_face` than in `evaluate_faces`.
by_sample = njit(nogil=True, error_model="numpy", fastmath=_FAST - {"reassoc"})
# Kept on disk, with all it calls. numba takes what it kept for current as long as the function's own file is the same,
# whatever became of the others, and as long as what it closes over is the same: each closes over `SOURCE`.
kept = njit(cache=True, nogil=True, error_model="numpy")

SOURCE = int.from_bytes(
    hashlib.sha256(b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))).digest()[:7]
)
"""A number that changes whenever a file of this package does."""


@intrinsic
def stay_one_function(typing_context):
    """Keep LLVM from inlining the function this stands in.

    Inlined into `evaluate_faces` and `show_face` it would be optimised for each, and round differently: their energies are
    to agree to the bit.
    """

    def generate(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), generate
