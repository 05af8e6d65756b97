"""Helpers that are independent of meshes and photos.

What belongs here: code that could serve any program. The append-only block file (`block_file`), part files (`part_file`),
checked NumPy archives (`npz`), guards for input (`guards`), the budget of what is made of a file (`budget`), wrong uses of a
library told apart from damaged files (`misuse`), file locks (`file_lock`), the bounded cache (`bounded_cache`), the user's cache
folder (`cache_folder`), the eight orientations of an image (`orientation`) the source hash for numba's disk cache
(`source_hash`), and what other packages offer (`plugins`).

May import: `fairing.errors` only.
"""
