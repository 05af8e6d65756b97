"""Scripts: JavaScript modules of this package, each joined with those it imports to one script that makes no request.

Every script lies in a folder `web`, as a module that exports and imports names with
`import { name } from "./other.js";`, so that a linter knows them; `app/web` holds those that several pages share. A browser is
sent one script: the modules in the order in which they need each other, without these statements, comment lines and empty
lines. So two modules that meet in a script never declare the same name.
"""

import json
import posixpath
import re
from functools import cache
from importlib.resources import files
from typing import Any

_IMPORT = re.compile(r'^import \{[^}]*\} from "([^"]+)";\n', re.MULTILINE)
_COMMENT_OR_GAP = re.compile(r"^(?:[ \t]*//.*)?\n", re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(?:async )?(?:function|class|const|let) )", re.MULTILINE)


@cache
def script(path: str) -> str:
    """A module and all that it imports, as one script in strict mode. `path` is relative to the package `app`."""
    parts: dict[str, str] = {}
    _collect(path, parts, ())
    return '"use strict";\n' + "".join(parts.values())


def script_call(path: str, function: str, **parameters: Any) -> str:
    """A script that calls an exported function with an object of JSON values, and declares nothing outside.

    Args:
        path: of the module, relative to the package `app`.
        function: name of the function.
        parameters: properties of its argument.
    """
    return f"(() => {{\n{script(path)}\n{function}({json.dumps(parameters, allow_nan=False)});\n}})();"


def _collect(path: str, parts: dict[str, str], above: tuple[str, ...]) -> None:
    """Add the text of a module after those of the modules it imports."""
    assert path not in above, f"imports run in a circle: {' -> '.join((*above, path))}"
    if path in parts:
        return
    text = (files("app") / path).read_text(encoding="utf-8")
    for imported in _IMPORT.findall(text):
        _collect(posixpath.normpath(posixpath.join(posixpath.dirname(path), imported)), parts, (*above, path))
    parts[path] = _EXPORT.sub("", _IMPORT.sub("", _COMMENT_OR_GAP.sub("", text)))
