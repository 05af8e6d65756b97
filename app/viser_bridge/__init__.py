"""Everything that works around viser 1.1.1 or extends it. When viser is upgraded, this room is audited, nothing else.

Private names of viser (`viser._messages`, `handle._impl`, `server._websock_server`, its thread pool), its DOM and JavaScript
in the page are used here only. Each workaround is covered by a test that fails when viser changes. Numbers after # are
issues and pull requests of github.com/viser-project/viser.

Server
- `access`: origin, host and token checks. viser has no authentication, no origin check, and listens on 0.0.0.0 by default.
- `client_callbacks`: bounded callback queues, one a client, in the order of its messages. viser runs all callbacks from one
  unbounded queue on 32 threads.
- `message_event`: threads can push messages safely. viser sets an asyncio event from any thread.
- `malformed_messages`: what cannot be decoded is one line on the terminal. viser prints a traceback.
- `paced_connection`: limits the rate and size of incoming messages. viser accepts 50 MiB and any rate.
- `server`: a port in use and an unknown host are errors. viser takes the next port, and hangs on an unknown host. Removes
  the handlers that open a public tunnel (share.viser.studio), skips the default environment map, which takes seconds to
  decode, and silences the printed banner. Server threads that outlive the interpreter: #518, #744; `close` avoids them.

Panels
- `javascript`: viser has a message that runs JavaScript, but no public function for it. The scripts lie in `web`, most named as
  the module that sends them. `handlers.js` has the functions for attributes of our HTML; `before_frame.js` calls functions before
  a frame is drawn, which viser cannot; `once.js` waits for what a page that is still being built does not have.
- `html_events`, `text_field`: events of our own HTML. viser reports none, and of fast changes of its widgets only the last.
- `in_place`: keeps unchanged elements of HTML panels. viser replaces all of them.
- `html_panel`, `style_sheet`: content and style are sent only when they change.
- `viser_elements`: style of viser's own elements, by class names that it does not document.
- `keyboard_focus`, `hotkeys`: hotkeys are ignored while a widget has the focus; function keys are missing in their type; a
  command has one key; dialogs neither close by Escape nor keep keys from the page. Commands are experimental (#696).
- `drawn_elements`: viser shows HTML without scripts, so plots of exported pages are custom elements here.
- `completion`: text inputs complete nothing.
- `accessible_names`: sliders, number inputs and icons have no accessible name.
- `tabs`: viser cannot select a tab, scroll to a heading, reload the page or name the browser's tab.
- `view_overlay`: HTML over the 3D view needs a panel.
- `floating`, `view_width`: panels can float at a corner, but not span the view; `camera.image_width` counts
  rendered pixels, not those of the page.
- `presenter_style`: the content of panels is not scaled, and the width of the window is not reported.
- `synced_widget`: an assignment from Python calls the widget's callbacks, too.
- `slider_marks`: assignments to `slider.marks` have no effect.
- `error_toasts`: exceptions in callbacks are only printed.
- `software_rendering`: the warning of a browser without a graphics card stays over the 3D view.
- `opening_page`: before there is a scene, viser shows its own buttons on an empty page.
- `theme`: the theme is remembered by the browser.

Scene
- `mesh_swap`: a GLB node blinks when its file changes, and textures or vertex colors need GLB (#249, #562).
- `moving_texture`: the vertices of a GLB mesh cannot be moved.
- `split_view`: every node is drawn in the whole view.
- `instance_marks`: a node with another number of instances is made anew, and loses clicks meanwhile; levels of detail leave
  small shapes as they are.
- `corner_control`: callbacks of transform controls overtake each other.
- `line_node`, `triangle_node`: a node without line segments or faces is an error in the browser.
- `linear_colors`: colours of single line ends and instances are drawn too bright.
- `screen_ring`, `screen_limit`: shapes have no constant size on the screen, and no largest one.
- `node_events`: a click is reported for the node and for the scene; modifiers match exactly; synchronous callbacks may
  overtake each other. Hover outlines of large meshes are slow (#565), so only marks and frusta are clickable.
- `camera_pose`: camera setters skip values equal to the browser's last report, which may be out of date.
- `picking_camera`: the browser's camera as a pinhole camera.
- `photo_background`: background images are stretched to the window; cameras have a centred principal point.

May import the loose modules of `app` and of `fairing`.
"""
