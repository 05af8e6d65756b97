"""The site: guides and API reference as pages that need no server, with one search, rendered by pdoc."""

import importlib
import types
from collections.abc import Callable, Mapping
from pathlib import Path

import pdoc.doc
import pdoc.render
from pygments import highlight
from pygments.formatters import HtmlFormatter
from pygments.lexers import PythonLexer

from app.guides.guide import ROOT, Guide, Section, guides
from fairing.errors import InputError
from fairing.io import locked_output_folder, write_atomically

API: Mapping[str, tuple[str, ...]] = {
    "Run": ("fairing", "fairing.options", "fairing.run.session", "fairing.trace", "fairing.paper"),
    "Inspect": ("fairing.judge.inspect", "fairing.judge.flow", "fairing.judge.certainty"),
    "Measure": (
        "fairing.judge.metrics", "fairing.judge.report", "fairing.judge.cramer_rao", "fairing.experiments",
        "fairing.experiments.experiment", "fairing.experiments.setting",
    ),
    "Files": ("fairing.io", "fairing.io.capture", "fairing.util.block_file"),
    "Tools": ("fairing.triangulation", "fairing.registration.alignment", "fairing.texture", "demo_scenes"),
    "Notebooks": ("app",),
}  # fmt: skip
"""The modules of the API reference, in groups."""

_PREFIX = "guides."  # of the pages of guides


def write_site(folder: Path) -> None:
    """Write the site to a folder: new, empty, or of an earlier call.

    Raises:
        InputError: the folder holds other files, or cannot be written.
    """
    found = {_PREFIX + guide.name: guide for guide in guides()}
    _configure(found)
    api = {name: _api_module(name) for names in API.values() for name in names}
    pages = {name: _guide_module(name, guide) for name, guide in found.items()} | api
    with locked_output_folder(folder):
        write = _writer(folder)
        for name, module in pages.items():
            write(f"{name.replace('.', '/')}.html", pdoc.render.html_module(module, pages))
        write("index.html", pdoc.render.html_index(pages))
        searched = {guide.title: _searched(name, guide) for name, guide in found.items()}
        write("search.js", pdoc.render.search_index(searched | api))
        for path in sorted({guide.file_of(target) for guide in found.values() for target in _local(guide)}):
            address = _address_of(path)
            if path.suffix == ".py":
                write(address, _source_page(path))
            elif not address.startswith(_PREFIX[:-1]):
                write(address, path.read_bytes())


def _configure(found: Mapping[str, Guide]) -> None:
    templates = Path(__file__).with_name("templates")
    pdoc.render.configure(
        docformat="google", show_source=False, footer_text="EigenFairing", template_directory=templates
    )
    pdoc.render.env.globals |= {"guides": found, "api_groups": API}


def _writer(folder: Path) -> Callable[[str, str | bytes], None]:
    def write(name: str, content: str | bytes) -> None:
        path, data = folder / name, content.encode() if isinstance(content, str) else content
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent}: cannot be created ({error.strerror}); choose another folder") from None
        write_atomically(path, lambda file: file.write(data))

    return write


def _api_module(name: str) -> pdoc.doc.Module:
    module = importlib.import_module(name)
    # Some packages import their members when these are first used; pdoc looks only at those that are there.
    for member in getattr(module, "__all__", ()):
        setattr(module, member, getattr(module, member))
    return pdoc.doc.Module(module)


def _guide_module(name: str, guide: Guide) -> pdoc.doc.Module:
    """A module whose docstring is the guide, because pdoc renders modules."""
    return _module(name, guide.page_text(lambda target: _address(guide, target)))


def _searched(name: str, guide: Guide) -> pdoc.doc.Module:
    """The guide for the search: each section is a member, so that a result is a section and leads to it."""
    first, *others = guide.sections
    module = _module(name, first.text)
    module.fullname = guide.title  # the heading of a result
    module.own_members = [_member(name, guide, section) for section in others]
    return module


def _member(name: str, guide: Guide, section: Section) -> pdoc.doc.Variable:
    member = pdoc.doc.Variable(name, section.anchor, taken_from=(name, section.anchor), docstring=section.text)
    member.fullname = f"{guide.title}: {section.title}"
    return member


def _module(name: str, text: str) -> pdoc.doc.Module:
    module = types.ModuleType(name, text)
    module.__dict__.update(__docformat__="markdown", __all__=[])
    return pdoc.doc.Module(module)


def _local(guide: Guide) -> list[str]:
    """The targets of a guide that are files."""
    return [target for target in guide.targets if "://" not in target]


def _address(guide: Guide, target: str) -> str:
    """Address of a link's target, from the page of a guide."""
    if "://" in target or target.startswith("#"):
        return target
    path, fragment = guide.file_of(target), target.partition("#")[2]
    if path.suffix == ".py" and fragment:  # lines: L60-L64, as GitHub marks them
        fragment = fragment.partition("-")[0].replace("L", "L-")
    return f"../{_address_of(path)}" + (f"#{fragment}" if fragment else "")


def _address_of(path: Path) -> str:
    """Address of a file of the repository, from the root of the site.

    Source code becomes a page, because some web servers run or refuse files with this suffix.
    """
    if path in {guide.path for guide in guides()}:
        return f"guides/{path.stem}.html"
    if path.suffix == ".jpg":
        return f"pictures/{path.name}"
    return f"files/{path.relative_to(ROOT)}{'.html' if path.suffix == '.py' else ''}"


def _source_page(path: Path) -> str:
    formatter = HtmlFormatter(
        full=True, linenos="inline", lineanchors="L", anchorlinenos=True, title=str(path.relative_to(ROOT))
    )
    return highlight(path.read_text(encoding="utf-8"), PythonLexer(), formatter)
