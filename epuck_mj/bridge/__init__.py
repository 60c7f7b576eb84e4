"""The bridge to a real e-puck: the policy that was evolved here drives it there.

Bytes and times as arguments; nothing opens a port, waits or looks at a clock:

- `protocol`: the robot's language; `ascii`, `binary` and `packets` are its three
  dialects, `replies` and `parsing` what they share.
- `firmware` and `wifi_firmware`: an e-puck of the `builds` there are, which answers as
  the real ones do, quirks included, around any `body`; `wire` is what lies between it
  and a host.

With ports and clocks:

- `serial_port`: a port, the only `import serial`; `link`: a conversation on it;
  `serial_line` and `wifi_line`: what a `connection` offers, on either.
- `robot`: `control.Robot` on a connection, with `schedule` and `odometry`; its
  `session`, the control loop; its `mission`, from the first word to the `log`.
- `guardian`, `keyboard`: what ends a mission, and who stops the robot.
- `fake`: a robot to try it all on.
"""
