"""Functions of the page that are called before each frame of the 3D view is drawn; viser 1.1.1 has no such hook."""

import viser

from app.viser_bridge.javascript import run_in_page

# three.js calls `onBeforeRender` of the scene once a frame, after it has updated the matrices of nodes and camera.
_SCRIPT = """
{
  const install = () => {
    const view = window.__viserMutable;
    if (!view?.scene) return void setTimeout(install, 50);
    window.eigenfairingFrames ??= {};
    window.eigenfairingFrames[%r] = (%s)(view);
    view.scene.onBeforeRender = () => { for (const call of Object.values(window.eigenfairingFrames)) call(); };
    view.requestRender?.();
  };
  install();
}
"""

FIND_MESH = """(view, name) => {
    let found = null;
    view.nodeRefFromName?.[name]?.traverse(node => {
      if (!found && node.isMesh && node.geometry?.attributes?.position) found = node;
    });
    return found;
  }"""
"""JavaScript: a function that returns the three.js mesh of a node, or null."""


def call_before_frames(client: viser.ClientHandle, name: str, make: str) -> None:
    """Call a function before every frame in this browser, in place of an earlier one of this name.

    Args:
        make: JavaScript: a function that receives viser's view, called once the view exists, and returns the function.
    """
    run_in_page(client.gui, _SCRIPT % (name, make))
