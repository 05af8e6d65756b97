"""The state of one browser's page: selection, layers, cells columns and the viewed moment.

The engine is shared by all pages, this is not. May import `app.debugger` and `app.viser_bridge`.
"""
