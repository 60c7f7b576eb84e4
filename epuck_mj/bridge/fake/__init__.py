"""A robot to try the bridge on: `python -m epuck_mj.bridge.fake`.

An e-puck's firmware, oddities included, with a body that is simulated by MuJoCo. Its
port sends only what a real robot would send.

- `firmware`, `wifi_firmware`: what the robot's programs make of bytes; the `builds`
  there are;
- `motors_and_sensors`: what these programs move and read; `mujoco_body`: a body of them
  in a scene;
- `scenarios`: what goes wrong, and when; `wire`: where bytes are late or lost;
- `emulator`: body, firmware and wires; bytes and times are arguments;
- `endpoints`: a pseudo-terminal or a TCP port around it, in real time.
"""
