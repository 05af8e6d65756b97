"""Terms, a norm and a plan of one's own from Python files that the user names."""

import importlib.util
import sys
import traceback
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from fairing.errors import InputError
from fairing.norms.norm import Norm, tabulated
from fairing.run.own_plan import check_plan
from fairing.run_plan import PlanStage
from fairing.terms.own import OwnTerm, check_terms
from fairing.util.plugins import offered


class Own(NamedTuple):
    """What a user adds to a run, as `Session` takes it.

    Attributes:
        terms: beside the built-in ones.
        norm: instead of that of the options; None: that one.
        plan: instead of what the start calls for; None: that.
        plan_file: the file that defines the plan; empty without one.
    """

    terms: tuple[OwnTerm, ...] = ()
    norm: Norm | None = None
    plan: tuple[PlanStage, ...] | None = None
    plan_file: str = ""


def load_own(files: Iterable[Path]) -> Own:
    """One instance of each subclass of `OwnTerm` and `Norm` that the files define, in their order, and the list `plan`.

    The code of the files is executed. A file is read anew each time. A plan may also be a function without arguments that
    returns the list. Instead of a file there may be a name that another package offers, as an entry point of the group
    `fairing.terms`, `fairing.norms` or `fairing.plans`.

    Raises:
        InputError: a file cannot be read or executed, or defines nothing of these, or something that cannot be used.
    """
    found = [_own_of(file) for file in files]
    terms = tuple(term for each in found for term in each.terms)
    check_terms(terms)
    norms = [each.norm for each in found if each.norm is not None]
    plans = [(each.plan, each.plan_file) for each in found if each.plan is not None]
    for what, several in (("norm", norms), ("plan", plans)):
        if len(several) > 1:
            raise InputError(f"expected one {what} in all files, found {len(several)}; leave the others out")
    return Own(terms, norms[0] if norms else None, *(plans[0] if plans else (None, "")))


def _own_of(file: Path) -> Own:
    if not file.suffix and not file.exists():
        name = str(file)
        if (kind := offered("fairing.terms").get(name)) is not None:
            return Own(terms=(kind(),))
        if (kind := offered("fairing.norms").get(name)) is not None:
            return Own(norm=_checked(kind()))
        if (plan := offered("fairing.plans").get(name)) is not None:
            return Own(plan=_plan(plan))
    file, wanted = file.absolute(), "subclasses of fairing.OwnTerm, a subclass of fairing.Norm or a list named plan"
    if file.suffix != ".py" or not file.is_file():
        raise InputError(f"{file}: expected a Python file with {wanted}, found no such file")
    name = f"fairing_own_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # the classes look up their file there
    try:
        # Not `spec.loader`: its cache goes by the second.
        exec(compile(file.read_bytes(), file, "exec"), module.__dict__)
        own = _defined(module)
    except InputError as error:
        raise InputError(f"{file.name}: {error}") from error
    except SyntaxError as error:
        raise InputError(f"{file.name}, line {error.lineno}: {error.msg}") from error
    except Exception as error:
        lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(file)]
        where = f"{file.name}, line {lines[-1]}" if lines else file.name
        raise InputError(f"{where}: {type(error).__name__}: {error}") from error
    if own == Own():
        raise InputError(f"{file}: expected {wanted}, found none")
    return own if own.plan is None else own._replace(plan_file=str(file))


def _defined(module: ModuleType) -> Own:
    kinds = [
        value for value in vars(module).values() if isinstance(value, type) and value.__module__ == module.__name__
    ]
    norms = [kind for kind in kinds if issubclass(kind, Norm) and not any(kind in other.__bases__ for other in kinds)]
    if len(norms) > 1:
        raise InputError(f"expected one norm, found {', '.join(kind.__name__ for kind in norms)}; leave the others out")
    terms = tuple(kind() for kind in kinds if issubclass(kind, OwnTerm))
    return Own(
        terms, _checked(norms[0]()) if norms else None, _plan(vars(module)["plan"]) if "plan" in vars(module) else None
    )


def _checked(norm: Norm) -> Norm:
    """A norm whose mistakes are told now, before photos are read."""
    tabulated(norm)
    return norm


def _plan(found: object) -> tuple[PlanStage, ...]:
    stages = found() if callable(found) else found
    check_plan(stages)
    assert isinstance(stages, Sequence)
    return tuple(stages)
