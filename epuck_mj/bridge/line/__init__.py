"""The cable: serial ports, WiFi, connections, who stops a lost robot."""
