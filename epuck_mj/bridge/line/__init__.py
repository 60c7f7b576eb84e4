"""The cable: serial ports, WiFi, connections, who stops a lost robot.

`serial_port` is a port, the only `import serial`; `link` a conversation on it;
`serial_line` and `wifi_line` offer what `interfaces` asks of a connection; `guardian`
stops the robot of a bridge that was killed.
"""
