"""A robot to try the bridge on: `python -m epuck_mj.bridge.fake`.

An e-puck's firmware, quirks included, in a body that lives in MuJoCo. Whoever opens its
port finds nothing that a real one would not say.

- `body`: the wheels and sensors, in a scene;
- `scenarios`: what goes wrong, and when;
- `emulator`: body, firmware and wires; bytes and times are arguments;
- `endpoints`: a pseudo-terminal or a TCP port around it, in real time;
- `virtual`: the same in a time of its own, for tests.
"""
