"""Notebooks: runs and experiments as frames in a notebook, and progress bars.

Belongs here: what `from app import show, progress, measure` offers. No notebook package is imported: a notebook is
recognised by the IPython that runs the code, and results have `_repr_html_`.

May import: `app.export`, `app.page` and `app.debugger` (for the live debugger), `app.experiments`, `app.files`, `app.panels`
(functions that return markup), `app.viser_bridge`, the loose modules of `app`, and `fairing`.

Offers: `show`, `progress`, `measure`.
"""
