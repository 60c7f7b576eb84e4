"""Shapes: every kind of geom is seen in a recording as MuJoCo would draw it."""

import mujoco
import numpy as np

from epuck_mj.scene.geometry import arena_box, color, drawn
from epuck_mj.show.recording import shapes

SHAPES = """
<mujoco>
  <asset>
    <material name="red" rgba="1 0 0 1"/>
    <texture name="flat" type="2d" builtin="flat" rgb1=".2 .4 1" width="8" height="8"/>
    <material name="tiles" rgba="1 1 0.5 1" texture="flat"/>
    <mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="0 0 1" material="tiles"/>
    <geom name="box" type="box" size="1 2 3" pos="4 0 3" zaxis="0 1 1"/>
    <geom name="ball" type="sphere" size="0.5" material="red"/>
    <geom name="egg" type="ellipsoid" size="0.5 1 2"/>
    <geom name="pill" type="capsule" size="0.5 1"/>
    <geom name="can" type="cylinder" size="0.5 1" group="3"/>
    <geom name="wedge" type="mesh" mesh="wedge"/>
    <geom name="ghost" type="sphere" size="1" rgba="1 1 1 0"/>
    <body name="bare"><geom name="hidden" size="1" group="3" mass="1"/></body>
  </worldbody>
</mujoco>
"""


def test_every_shape_is_drawn_unless_it_is_not_meant_to_be_seen():
    model = mujoco.MjModel.from_xml_string(SHAPES)
    seen = [model.geom(geom).name for geom in np.flatnonzero(drawn(model))]
    # a body that shows nothing else shows what it collides with
    assert seen == ["", "box", "ball", "egg", "pill", "wedge", "hidden"]
    np.testing.assert_array_equal(color(model, 2), [1, 0, 0, 1])
    mixed = color(model, 0)
    np.testing.assert_allclose(mixed, [0.2, 0.4, 0.5, 1], atol=1 / 255)
    kinds = [
        type(shapes._shape(model, geom)).__name__
        for geom in np.flatnonzero(drawn(model)).tolist()
    ]
    assert kinds == [
        "Boxes3D",
        "Boxes3D",
        "Ellipsoids3D",
        "Ellipsoids3D",
        "Capsules3D",
        "Mesh3D",
        "Ellipsoids3D",
    ]
    lower, upper = arena_box(model)
    half = (2 + 3) / np.sqrt(2)
    np.testing.assert_allclose([lower[0], upper[0]], [-1, 5], atol=1e-9)
    np.testing.assert_allclose([lower[1], upper[1]], [-half, half], atol=1e-9)
