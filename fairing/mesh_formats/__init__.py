"""Mesh file formats: PLY, OBJ, OFF, STL and glTF as documents that keep what EigenFairing does not use.

What belongs here: parsing the bytes of a mesh file into a document (`parse`), and writing its bytes anew with other vertex
positions. No file is opened here, except the ones that a glTF refers to, by a function given; errors do not name the file.
May import the loose modules, `fairing.util` and `fairing.geometry`.
"""
