"""Helpers without any knowledge of meshes or photos.

Holds lazy imports, the append-only block file, part files, NumPy archives, guards for input, the
bounded cache and the user's cache folder. May
import `fairing.errors` only.
"""
