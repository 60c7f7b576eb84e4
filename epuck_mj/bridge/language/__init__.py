"""The bytes that an e-puck's firmwares understand and send.

`ascii`, `binary` and `packets` are its three dialects; `replies` and `parsing` are what
they share; `protocol` says how they are used.
"""
