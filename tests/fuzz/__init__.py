"""Fuzzing of everything that reads files: `python -m tests.fuzz --cases 20000`.

A case is a seed (a small valid input), a mutation of one of its files, and a number that makes both reproducible. It passes
if the input is read or refused with an InputError of one line, in bounded time and memory and without a warning.
"""
