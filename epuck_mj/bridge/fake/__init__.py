"""A robot to try the bridge on: `python -m epuck_mj.bridge.fake`.

An e-puck's firmware, oddities included, with a simulated body. Its port sends only what
a real robot would send.

- `firmware`, `wifi_firmware`: the robot's programs; `builds`: their versions;
- `motors_and_sensors`: motors and sensors of these programs; `simulated_body`: a body
  with them in a scene;
- `scenarios`: faults and their times; `wire`: a line that delays or loses bytes;
- `emulator`: body, firmware and wires, with bytes and times as arguments;
- `endpoints`: a pseudo-terminal or a TCP port of the emulator, in real time.
"""
