"""Helpers that are independent of meshes and photos.

What belongs here: code that could serve any program. Lazy imports (`on_demand`), the append-only block file (`block_file`),
part files (`part_file`), checked NumPy archives (`npz`), guards for input (`guards`), the bounded cache (`bounded_cache`),
the user's cache folder (`cache_folder`) and the source hash for numba's disk cache (`source_hash`).

May import: `fairing.errors` only.
"""
