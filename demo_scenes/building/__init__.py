"""The scene family `building:SEED`: buildings, photos and start meshes drawn from a seed.

The package holds what is specific to the family: the random building, its surroundings, cameras, start meshes and sparse
points. It builds on the modules beside it, and the engine never imports it. Its code enters the cache key of its own
photos only.
"""
