"""Simulated range data of demo scenes. (A package of its own: what lies beside the photos' code outdates cached photos.)"""
