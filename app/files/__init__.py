"""Files of the app: where scenes come from, run folders, JSON reports and HTML documents.

May import `fairing`, `demo_scenes` and `app.pictures`.
"""
