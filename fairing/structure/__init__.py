"""Structure from motion: a capture from photos alone, whose cameras are not known.

What belongs here: the photos of a folder (`photo_set`), reduced and turned upright (`preparation`), the pairs to match (`pairs`),
the child process that runs pycolmap (`worker`, `child`), why photos could not be placed (`outcome`), the frame of the capture
(`frame`), and the whole (`reconstruction`, `options`).

pycolmap is optional: `pip install "eigenfairing[photos]"`. Only `worker` imports it, in a process of its own.

May import: the data modules of `fairing`, `fairing.util`, `fairing.io`, `fairing.triangulation` and `fairing.placement`.
"""
