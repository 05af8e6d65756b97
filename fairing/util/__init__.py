"""Helpers that are independent of meshes and photos.

What belongs here: code that could serve any program: lazy imports (`on_demand`), the append-only block file (`block_file`), the
bounded cache (`bounded_cache`) and the source hash for numba's disk cache (`source_hash`).

May import: `fairing.errors` only.
"""
