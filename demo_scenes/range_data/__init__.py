"""Simulated range data of demo scenes.

A package of its own, because the cache key of photos covers all modules beside the photos' code.
"""
