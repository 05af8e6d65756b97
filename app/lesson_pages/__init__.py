"""Lesson pages: lessons as self-contained HTML files that need no server, no network and no program.

Belongs here: playing a lesson without a page, the data and texts of its file, the index of several lessons, and the
scripts of these files (`web/`). The lesson texts are those of `app.lessons`; the scripts of a replay page are those of
`app.export`.

May import: `app.lessons`, `app.export`, `app.experiments`, `app.panels` (functions that return markup), `app.page_state`,
`app.debugger`, `app.pictures`, the loose modules of `app`, `demo_scenes` and `fairing`.

Offers: `write_lesson`, `write_lessons`.
"""
