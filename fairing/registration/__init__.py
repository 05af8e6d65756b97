"""Registration: range data aligned with the frame of the photos.

May import the data modules of `fairing` and `fairing.geometry`.
"""
