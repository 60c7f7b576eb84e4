"""The bytes that an e-puck's firmwares understand and send."""
