"""Pictures: everything the page and the reports show that is computed as pixels, textures or colours.

Belongs here: pictures of cells, crops of photos, the timeline's strip, textured and coloured meshes, predicted photos,
contact sheets of the check page. The JPEG files are the pictures of the README and of the guides.

May import: `fairing`, `app.debugger`, `app.page_state` and the loose modules of `app`, NumPy and OpenCV; never viser.

Offers: functions from engine data to (h, w, 3) uint8 RGB arrays or HTML data URIs, and workers (`Texturer`,
`Predictor`) that compute slow pictures on background threads.
"""
