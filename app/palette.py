"""The colours of the page, in one place; the same colour means the same thing everywhere.

After Okabe and Ito's palette, which people with any kind of colour vision can tell apart. Start is green and now is
red, as in the paper's figures.
"""

RGB = tuple[int, int, int]

START: RGB = (0, 178, 128)
NOW: RGB = (238, 86, 48)
SELECTED: RGB = (245, 222, 66)
TRUTH: RGB = (96, 184, 240)
LOCKED: RGB = (134, 142, 150)
HAND: RGB = (236, 238, 242)
REJECTED: RGB = (204, 121, 167)
REFERENCE: RGB = (178, 160, 255)
CAMERA: RGB = (120, 138, 158)
CAMERA_ENTERED: RGB = (245, 222, 66)
SURFACE: RGB = (128, 132, 140)
POINTS: RGB = (214, 218, 224)

BACKGROUND: RGB = (24, 26, 30)
BRAND: RGB = (64, 132, 214)


def css(color: RGB, opacity: float = 1.0) -> str:
    """The colour as CSS text."""
    return f"rgba({color[0]},{color[1]},{color[2]},{opacity:g})"
