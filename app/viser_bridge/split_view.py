"""Split view: a divider, with some meshes at its left and others at its right; viser 1.1.1 draws every node in the whole view."""

import json
from collections.abc import Sequence

import viser

from app.viser_bridge.before_frame import call_before_frames
from app.viser_bridge.javascript import run_in_page

# three.js calls `onBeforeRender` and `onAfterRender` of a mesh around its drawing: between them WebGL draws within a rectangle.
_MAKE = """view => {
  const sides = %s, nothing = () => {};
  const leave = renderer => renderer.getContext().disable(WebGLRenderingContext.SCISSOR_TEST);
  const enter = side => renderer => {
    const gl = renderer.getContext(), width = gl.drawingBufferWidth, cut = Math.round(width * window.eigenfairingDivider);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(side ? cut : 0, 0, side ? width - cut : cut, gl.drawingBufferHeight);
  };
  const entered = [enter(0), enter(1)];
  return () => {
    const isOn = window.eigenfairingDivider !== undefined;
    sides.forEach((names, side) => names.forEach(name => view.nodeRefFromName?.[name]?.traverse(node => {
      if (!node.isMesh) return;
      node.onBeforeRender = isOn ? entered[side] : nothing;
      node.onAfterRender = isOn ? leave : nothing;
    })));
  };
}"""

_DIVIDER = """
{
  const isOn = %s, words = %s;
  const place = () => {
    const view = window.__viserMutable, parent = view?.canvas?.parentElement;
    if (!parent) return void setTimeout(place, 50);
    let divider = document.getElementById('eigenfairing-divider');
    if (!isOn) {
      divider?.remove();
      delete window.eigenfairingDivider;
      return void view.requestRender?.();
    }
    if (divider) return;
    divider = document.createElement('div');
    divider.id = 'eigenfairing-divider';
    divider.className = 'ef';
    divider.tabIndex = 0;
    divider.setAttribute('role', 'slider');
    divider.setAttribute('aria-label', words);
    divider.setAttribute('aria-valuemin', 0);
    divider.setAttribute('aria-valuemax', 100);
    const [left, right] = words.split(' | ');
    divider.innerHTML = `<span>${left} ◂▸ ${right}</span>`;
    const move = part => {
      window.eigenfairingDivider = Math.min(0.98, Math.max(0.02, part));
      divider.style.left = `${100 * window.eigenfairingDivider}%%`;
      divider.setAttribute('aria-valuenow', Math.round(100 * window.eigenfairingDivider));
      view.requestRender?.();
    };
    divider.addEventListener('pointerdown', event => { divider.setPointerCapture(event.pointerId); event.stopPropagation(); });
    divider.addEventListener('pointermove', event => {
      if (!divider.hasPointerCapture(event.pointerId)) return;
      const box = parent.getBoundingClientRect();
      move((event.clientX - box.left) / box.width);
    });
    divider.addEventListener('keydown', event => {
      const by = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      move(window.eigenfairingDivider + by);
    });
    parent.append(divider);
    move(0.5);
  };
  place();
}
"""
DIVIDER_STYLE = """
#eigenfairing-divider { position: absolute; top: 0; bottom: 0; width: 21px; margin-left: -10px; padding: 0; cursor: ew-resize;
  touch-action: none; }
#eigenfairing-divider::before { content: ""; position: absolute; left: 9px; top: 0; bottom: 0; width: 2px;
  background: var(--strong); opacity: .8; }
#eigenfairing-divider:focus-visible { outline: none; }
#eigenfairing-divider:focus-visible::before { width: 4px; left: 8px; opacity: 1; }
#eigenfairing-divider span { position: absolute; top: 12%; left: 50%; transform: translateX(-50%); padding: 3px 9px;
  border-radius: 12px; white-space: pre; background: var(--strong); color: var(--ink); font-size: 12px; font-weight: 600; }
"""


class SplitView:
    """The divider of one browser.

    Args:
        left, right: names of the nodes on each side of it.
        words: names of both sides.
    """

    def __init__(
        self, client: viser.ClientHandle, left: Sequence[str], right: Sequence[str], words: tuple[str, str]
    ) -> None:
        self._client, self._words, self._is_on = client, words, False
        call_before_frames(client, "split view", _MAKE % json.dumps([list(left), list(right)]))

    def set(self, is_on: bool) -> None:
        """Show the divider, which the user drags, or draw all nodes in the whole view."""
        if is_on != self._is_on:
            self._is_on = is_on
            run_in_page(self._client.gui, _DIVIDER % (json.dumps(is_on), json.dumps(" | ".join(self._words))))
