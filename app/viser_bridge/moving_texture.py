"""Moving texture: a textured mesh follows the vertices of a plain mesh, within the browser.

viser 1.1.1 cannot move the vertices of a GLB mesh, and sending the file again with every step would be too slow. So the page
copies the positions of the plain mesh, which are sent with every state, to the textured ones before each frame.
"""

import viser

from app.viser_bridge.javascript import run_in_page


def follow_plain_mesh(client: viser.ClientHandle, source: str, targets: list[str], offset: float) -> None:
    """Make textured meshes follow a plain one in this browser.

    Args:
        source: name of the plain mesh's node.
        targets: names of the nodes of the textured meshes; they have the corners of its faces as vertices.
        offset: distance by which the textured surface lies behind the plain one, along the vertex normals, scene units.
    """
    run_in_page(client.gui, "moving_texture", "followPlainMesh", source=source, targets=targets, offset=offset)
