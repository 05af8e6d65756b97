"""Export: a recorded run as a self-contained file: a replay page, a report, a picture or a video.

Belongs here: the writers of these files, the figures and texts they share, and the replay page's own scripts (`web/`).

May import: `app.debugger`, `app.files`, `app.pictures`, the loose modules of `app`, and `fairing`; never viser.

Offers: `write_page`, `write_report`, `write_picture` and `write_video`; each takes the `RunFacts` of a run.
"""
