"""Registration: alignment of range data with the frame of the photos.

What belongs here: the similarity from matched points or by iterated closest points (`alignment`), and the choice of scan points
for a start mesh (`scan_points`).

May import: the data modules of `fairing` and `fairing.geometry`.

Offers: `Similarity`, `Match`, `register_matches`, `refine_by_closest_points`, `critical_points`, `seen_points`.
"""
