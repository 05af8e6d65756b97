"""Pictures made with NumPy and OpenCV: cells, textures, colours, crops of photos, contact sheets.

May import `fairing`, `app.debugger` and the loose modules of `app`; never viser.
"""
