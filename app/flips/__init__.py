"""The page of a flip record: image-consistent triangulation, flip by flip, forwards and backwards.

`server.FlipApp` serves a record; `opening.open_flips` reads it with its photos. Shares its frame (camera, theme, hotkeys,
HTML events) with the debugger's page. May import `app.page.page_frame` and what that may import; imported by `app.cli`.
"""
