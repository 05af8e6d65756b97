"""Helpers that are independent of meshes and photos.

Holds lazy imports, the append-only block file, part files, NumPy archives, guards for input and the bounded cache. May
import `fairing.errors` only.
"""
