"""The bridge to a real e-puck: the policy that was evolved here drives it there.

- `protocol`: the robot's language, bytes only; `ascii`, `binary` and `packets` are its
  three dialects, `replies` and `parsing` what they share.
- `firmware` and `wifi_firmware`: an e-puck of the `builds` there are, which answers as
  the real ones do, quirks included, around any `body`; `wire` is what lies between it
  and a host.

Nothing of this opens a port, waits or looks at a clock: bytes and times are arguments.
"""
