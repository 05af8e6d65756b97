"""The debugger's page: the server, one page a browser, and the user's interaction with the scene.

May import every room of `app` except `app.cli` and `app.flips`.
"""
