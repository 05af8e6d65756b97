"""Geometry of meshes and cameras, without photos.

Holds rasterization, closest points, face normals and quality, mesh inspection and normal filtering.
May import the data modules of `fairing`.
"""
