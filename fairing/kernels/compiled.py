"""Compiler settings of the kernels, and their cache on disk.

- `error_model="numpy"`: Python's check for division by zero is a branch, and a loop with a branch does not vectorise
  (ledger: kernel error model).
- Loops run over `range(n)` of slices, which avoids the test for negative indices.

Cells are float32; sums over pairs of cells, energies and normal equations are accumulated in float64.
"""

from pathlib import Path

from numba import njit, types
from numba.extending import intrinsic

from fairing.util.compiled_only import COMPILED_ONLY
from fairing.util.source_hash import source_hash

# Reassociation allows sums to vectorise; the compiled code is fixed, so runs repeat to the bit on one kind of processor.
_FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}

# Called by compiled functions only. LLVM optimises a function again where it is linked to another, and a process that loads the
# cache calls that second version: every loop must round alike in both, as `plain` does (ledger: one rounding in two processes).
plain = njit(nogil=True, error_model="numpy", **COMPILED_ONLY)
# For sums of one product a term: in a sum of two, `contract` leaves open which is rounded before the addition.
fast = njit(nogil=True, error_model="numpy", fastmath=_FAST, **COMPILED_ONLY)
# For the samplers, 5 to 9 % slower in `plain`; with `reassoc` the cubic one rounded differently in `show_face`.
by_sample = njit(nogil=True, error_model="numpy", fastmath=_FAST - {"reassoc"}, **COMPILED_ONLY)
# Cached on disk, with all that the function calls; for functions that close over `SOURCE`.
cached = njit(cache=True, nogil=True, error_model="numpy", no_cfunc_wrapper=True)  # pyright: ignore[reportCallIssue]

SOURCE = source_hash(Path(__file__).parent)
"""Changes with any file of this package, see `fairing.util.source_hash`."""


@intrinsic
def never_inline(typing_context):
    """Keep LLVM from inlining the calling function.

    Inlined into `evaluate_faces` and `show_face` it would be optimised separately for each and round differently, but their
    energies must agree to the bit.
    """

    def generate(context, builder, signature, arguments):
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return types.void(), generate
