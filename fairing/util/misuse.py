"""Wrong use of a library, told apart from damaged files.

Readers turn whatever a library raises on damaged bytes into an `InputError` about the file. A library of another version, which
lacks a function or an argument, is no fault of the file.
"""

from types import ModuleType


def is_misuse(error: BaseException) -> bool:
    """Whether an exception shows that a library was called in a way that it does not support.

    These are modules, names and attributes of modules or classes that do not exist, calls from this package with arguments that
    the function does not take, and all errors of OpenCV, which reads no files here.
    """
    if isinstance(error, AttributeError):
        return isinstance(error.obj, (ModuleType, type))
    if isinstance(error, TypeError):
        return _is_raised_here(error) and "argument" in str(error) and "()" in str(error)
    return isinstance(error, (ImportError, NameError)) or type(error).__module__ == "cv2"


def _is_raised_here(error: BaseException) -> bool:
    """Whether the innermost frame is of this package: arguments are bound in the frame of the caller."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace is not None and str(trace.tb_frame.f_globals.get("__name__")).split(".")[0] == "fairing"
