"""The line to a robot: serial ports, WiFi, connections, and the guardian.

`serial_port` is a port of pyserial, which only this module imports. `link` sends
requests and receives replies on a port. `serial_line` and `wifi_line` are connections
as in `interfaces`. `guardian` stops the robot of a bridge that was killed.
"""
