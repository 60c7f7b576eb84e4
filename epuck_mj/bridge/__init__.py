"""The bridge to a real e-puck, which an evolved policy drives.

- `language`: requests and replies as bytes, without ports and clocks.
- `line`: ports and connections over cable or WiFi; the guardian stops a lost robot.
- `drive`: the control loop on a connection, from the greeting to the log.
- `fake`: an emulated robot.
- `failures`: exceptions between a host and its robot.
"""
