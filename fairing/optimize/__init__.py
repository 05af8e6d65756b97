"""Robust least squares: losses, terms as rows, the joint solution of a Gauss-Newton step. No photo, no mesh format.

Everything that moves vertices by geometry alone is solved here: sparse points, axes of a building, image edges.
"""
