"""The bridge to a real e-puck, which an evolved policy drives.

- `language`: bytes only, no port, no clock: requests and what their replies mean.
- `line`: ports and connections: the cable or WiFi, and who stops a lost robot.
- `drive`: the control loop on a connection, from the first word to the log.
- `fake`: a robot to try it all on, without one.
- `failures`: what goes wrong between a host and its robot.
"""
