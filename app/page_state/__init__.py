"""The state of one browser's page: selection, layers, cells columns and the viewed moment. The engine is shared by all pages.

`PageState` holds the state; `selection`, `cells_state` and `cells_controls` change parts of it; `certainty_source` queries
the engine for one browser. May import `app.debugger`, `app.viser_bridge` and the loose modules of `app`; never viser.
"""
