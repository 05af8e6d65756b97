"""Demo scenes: synthetic buildings and shapes with exact truth, photographed by a ray caster.

By name: `load_demo`, `find_demo` (`Demo`), `is_demo`, `DEMOS`, `BUILDING`, `DEMO_NAMES`. With other photos: `Photography`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
