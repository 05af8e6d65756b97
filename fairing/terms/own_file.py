"""Terms of one's own from a Python file that the user names."""

import importlib.util
import sys
import traceback
from collections.abc import Iterable
from pathlib import Path

from fairing.errors import InputError
from fairing.terms.names import BUILT_IN
from fairing.terms.own import OwnTerm, check_terms
from fairing.util.plugins import offered


def load_terms(files: Iterable[Path]) -> tuple[OwnTerm, ...]:
    """One instance of each subclass of `OwnTerm` that the files define, in their order.

    The code of the files is executed. A file is read anew each time. Instead of a file there may be the name of a term that another
    package offers, as an entry point of the group `fairing.terms` that is such a class.

    Raises:
        InputError: a file cannot be read or executed, or defines no term, or one that cannot be used.
    """
    terms = tuple(term for file in files for term in _terms_of(file))
    check_terms(terms, BUILT_IN)
    return terms


def _terms_of(file: Path) -> list[OwnTerm]:
    if not file.suffix and not file.exists() and (kind := offered("fairing.terms").get(str(file))) is not None:
        return [kind()]
    file = file.absolute()
    if file.suffix != ".py" or not file.is_file():
        raise InputError(f"{file}: expected a Python file with subclasses of fairing.OwnTerm, found no such file")
    name = f"fairing_own_terms_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # the classes look up their file there
    try:
        exec(
            compile(file.read_bytes(), file, "exec"), module.__dict__
        )  # not `spec.loader`: its cache goes by the second
        found = [value() for value in vars(module).values() if _is_term(value, name)]
    except InputError:
        raise
    except SyntaxError as error:
        raise InputError(f"{file.name}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(file)]
        where = f"{file.name}, line {lines[-1]}" if lines else file.name
        raise InputError(f"{where}: {type(error).__name__}: {error}") from error
    if not found:
        raise InputError(f"{file}: expected subclasses of fairing.OwnTerm, found none")
    return found


def _is_term(value: object, module: str) -> bool:
    return isinstance(value, type) and issubclass(value, OwnTerm) and value.__module__ == module
