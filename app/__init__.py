"""The debugger in the browser and the command line.

Computes nothing about fairing: it shows a Session and its Trace.
"""
