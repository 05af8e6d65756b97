"""The debugger's page: the server, one page a browser, its camera and the selection of vertices.

`server.App` serves a session, `server.start` opens it and returns at once. `resources` are shared by all pages of a
session; `page.Page` is one browser's page, put together from `page_frame` (camera, theme, hotkeys, HTML events: shared with
`app.flips`), `page_panels`, `page_layers`, `lesson_dock`, `presenter` and `vertex_interaction`.

May import every room of `app` except `app.cli`, `app.export`, `app.files` and `app.flips`.
"""
