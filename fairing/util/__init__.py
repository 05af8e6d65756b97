"""Helpers without any knowledge of meshes or photos.

Holds lazy imports, the append-only block file, part files, NumPy archives, guards for input and the bounded cache. May
import `fairing.errors` only.
"""
