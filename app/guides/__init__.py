"""Guides: Markdown files for readers, and the site that contains them beside the API reference.

    python -m app.guides FOLDER

Belongs here: the guides (`method.md`, `accuracy.md`, `captures.md`, `debugger.md`, `python.md`, `extending.md`, `files.md`), the
reader of a guide (`guide`), the site (`site`, with pdoc's templates in `templates/`), and the command (`__main__`).

May import: `app.lessons` (formulas), `fairing.io` and `fairing.errors`; never viser. pdoc is imported by `site` alone: it is
installed by the extra `docs`.

Offers: `write_site`, and `guides`, which are also readable where they are: their links are relative files of this repository.
"""
