"""asperity: contact forces and torques between two textured objects, at haptic rates.

The public names are listed in `__init__.pyi`; each is loaded when it is first used.
"""

from __future__ import annotations

from typing import Any

import lazy_loader

from asperity._core.moved import install, renamed

__version__ = "0.1.0"

_lazy, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]
install()


def __getattr__(name: str) -> Any:
    if name in __all__:
        return _lazy(name)
    old = renamed(name)
    if old is None:
        raise AttributeError(f"module 'asperity' has no attribute {name!r}")
    return old
