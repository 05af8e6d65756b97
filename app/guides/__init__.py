"""Guides: Markdown files for readers, and the site that contains them beside the API reference.

Belongs here: the guides (`method.md`, `accuracy.md`, `captures.md`, `debugger.md`, `python.md`, `extending.md`, `files.md`), the
reader of a guide (`guide`), and the site (`site`, with pdoc's templates in `templates/`), which `eigenfairing docs` writes.

May import: `app.lessons` (formulas), `fairing.io` and `fairing.errors`; never viser. pdoc is imported by `site` alone: it is
installed by the extra `docs`.

Offers: `guides`, and `write_site`. Links of guides are relative paths, so that they also work where the repository is browsed.
"""
