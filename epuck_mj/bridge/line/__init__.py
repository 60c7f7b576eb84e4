"""The line to a robot: serial ports, WiFi, connections, and the guardian.

`serial_port` is a port, the only `import serial`; `link` a conversation on it;
`serial_line` and `wifi_line` offer what `interfaces` asks of a connection; `guardian`
stops the robot of a bridge that was killed.
"""
