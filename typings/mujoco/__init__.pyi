# mujoco's compiled parts come without types: whatever it offers is taken as it is.
from typing import Any

def __getattr__(name: str) -> Any: ...
