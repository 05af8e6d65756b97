"""The page of a record of `triangulate`: how points became a start mesh, its face splits and flips, step by step, both ways.

`story` has the chapters: those of the carving (`drawing`, `carving_view`), the face splits (`split_film`) and the flips (`film`).

`server.FlipApp` serves a record; `opening.open_flips` reads it with its photos. Shares its frame (camera, theme, hotkeys,
HTML events) with the debugger's page. May import `app.page.page_frame` and what that may import; imported by `app.cli`.
"""
