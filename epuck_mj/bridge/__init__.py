"""The bridge to real e-pucks, which evolved policies drive.

- `language`: requests and replies as bytes, without ports and clocks.
- `line`: ports and connections over cable or WiFi; the guardian stops a lost robot.
- `drive`: the control loop on a connection, from the greeting to the log.
- `fleet`: several robots at once, a process each.
- `fake`: an emulated robot.
- `failures`: exceptions between a host and its robot.
"""
