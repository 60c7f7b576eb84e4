"""Compiled motion and rays of robots in a plan.

Wheels roll without slipping. Their speeds follow commands with a first-order lag, whose
distances and angles over a substep are exact; the path within one is the chord of a
circle. No function of the system's mathematical library is called, so that every
processor gives the same bits.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.cones import widen
from epuck_mj.rungs.kinematic.plan import Body, Grid, Plan, Walls

# columns of a robot's state
X, Y, YAW, COS, SIN, AHEAD, AROUND, N_STATE = range(8)

# columns of a robot's own numbers
LEFT_AHEAD, TIME_AHEAD, LEFT_AROUND, TIME_AROUND, RADIUS, OUTWARD, N_OWN = range(7)


@compiled(forceinline=True)
def cell_of(grid: Grid, x, y):
    """Index of the cell of a place; the last one if it is outside of the grid."""
    i = np.int64(np.floor((x - grid.x) / grid.cell))
    j = np.int64(np.floor((y - grid.y) / grid.cell))
    if i < 0 or j < 0 or i >= grid.n_x or j >= grid.n_y:
        return grid.n_x * grid.n_y
    return i * grid.n_y + j


@compiled(forceinline=True)
def side_distance(sides, i, x, y):
    """Square of the distance of a place from a side [m^2]."""
    dx, dy = x - sides[i, 0], y - sides[i, 1]
    ex, ey = sides[i, 2], sides[i, 3]
    # of a side without length, 0 / 0 becomes its end
    share = (dx * ex + dy * ey) / (ex * ex + ey * ey)
    share = share if share > 0.0 else 0.0
    share = share if share < 1.0 else 1.0
    dx -= share * ex
    dy -= share * ey
    return dx * dx + dy * dy


@compiled()
def ellipse_distance(ellipses, i, x, y):
    """Square of the distance of a place from an ellipse [m^2]; 0 inside.

    The nearest point is (a^2 u / (t + a^2), b^2 v / (t + b^2)), where t is the largest
    root of a falling function, found by halving.

    Source: Eberly, Distance from a Point to an Ellipse (2013).
    """
    dx, dy = x - ellipses[i, 0], y - ellipses[i, 1]
    a, b = ellipses[i, 4], ellipses[i, 5]
    if a == b:
        off = max(sqrt(dx * dx + dy * dy) - a, 0.0)
        return off * off
    # in the frame and the first quarter of the ellipse
    u = abs(dx * ellipses[i, 2] + dy * ellipses[i, 3])
    v = abs(dy * ellipses[i, 2] - dx * ellipses[i, 3])
    if u * u / (a * a) + v * v / (b * b) <= 1.0:
        return 0.0
    low, high = 0.0, sqrt(u * u + v * v) * max(a, b)
    for _ in range(100):
        t = 0.5 * (low + high)
        p, q = a * u / (t + a * a), b * v / (t + b * b)
        if p * p + q * q > 1.0:
            low = t
        else:
            high = t
    t = 0.5 * (low + high)
    du, dv = u - a * a * u / (t + a * a), v - b * b * v / (t + b * b)
    return du * du + dv * dv


@compiled(forceinline=True)
def distance_to(walls: Walls, cell, x, y):
    """Distance of a place from the outlines near its cell [m]; infinite without any."""
    least, n = np.inf, walls.sides.shape[0]
    for k in range(walls.first[cell], walls.first[cell + 1]):
        i = walls.near[k]
        if i < n:
            square = side_distance(walls.sides, i, x, y)
        else:
            square = ellipse_distance(walls.ellipses, i - n, x, y)
        least = square if square < least else least
    return sqrt(least)


@compiled(forceinline=True)
def cast_at_side(rays, sides, i, x, y, cos, sin, length):
    """Shorten the rays `(n,)` of a robot that meet a side [m]."""
    # the side in the robot's frame
    dx, dy = sides[i, 0] - x, sides[i, 1] - y
    ax, ay = cos * dx + sin * dy, cos * dy - sin * dx
    dx, dy = sides[i, 2], sides[i, 3]
    ex, ey = cos * dx + sin * dy, cos * dy - sin * dx
    for k in range(length.shape[0]):
        ox, oy, ux, uy = rays[0, k], rays[1, k], rays[2, k], rays[3, k]
        px, py = ax - ox, ay - oy
        # parallel ones divide by 0, and no comparison holds
        inverse = 1.0 / (ux * ey - uy * ex)
        t = (px * ey - py * ex) * inverse
        share = (px * uy - py * ux) * inverse
        meets = (t >= 0.0) & (t < length[k]) & (share >= 0.0) & (share <= 1.0)
        length[k] = t if meets else length[k]


@compiled()
def cast_at_ellipse(rays, ellipses, i, x, y, cos, sin, length):
    """Shorten the rays `(n,)` of a robot that meet an ellipse [m]."""
    dx, dy = x - ellipses[i, 0], y - ellipses[i, 1]
    fx, fy = ellipses[i, 2], ellipses[i, 3]
    for k in range(length.shape[0]):
        ox = dx + cos * rays[0, k] - sin * rays[1, k]
        oy = dy + sin * rays[0, k] + cos * rays[1, k]
        ux = cos * rays[2, k] - sin * rays[3, k]
        uy = sin * rays[2, k] + cos * rays[3, k]
        # in units of the half axes
        px, py = (
            (ox * fx + oy * fy) / ellipses[i, 4],
            (oy * fx - ox * fy) / ellipses[i, 5],
        )
        vx, vy = (
            (ux * fx + uy * fy) / ellipses[i, 4],
            (uy * fx - ux * fy) / ellipses[i, 5],
        )
        a = vx * vx + vy * vy
        b = px * vx + py * vy
        square = b * b - a * (px * px + py * py - 1.0)
        if square < 0.0:
            continue
        root = sqrt(square)
        t = (-b - root) / a
        t = t if t >= 0.0 else (-b + root) / a
        if 0.0 <= t < length[k]:
            length[k] = t


@compiled(forceinline=True)
def cast(rays, edge, reach, walls: Walls, state, i, length):
    """Lengths of rays `(n,)` of robot `i` [m]; -1 where nothing is within reach."""
    x, y, cos, sin = state[i, X], state[i, Y], state[i, COS], state[i, SIN]
    n, far = walls.sides.shape[0], edge + reach
    for k in range(length.shape[0]):
        length[k] = np.inf
    cell = cell_of(walls.grid, x, y)
    for m in range(walls.first[cell], walls.first[cell + 1]):
        j = walls.near[m]
        if j >= n:
            cast_at_ellipse(rays, walls.ellipses, j - n, x, y, cos, sin, length)
        elif side_distance(walls.sides, j, x, y) <= far * far:
            cast_at_side(rays, walls.sides, j, x, y, cos, sin, length)
    for k in range(length.shape[0]):
        length[k] = -1.0 if length[k] > reach else length[k]


class Rays(NamedTuple):
    """Room for the rays of one robot.

    Attributes:
        middle: origin x, y and direction x, y in its frame, `(4, 8)`.
        aside: likewise those to the left of them, then to the right, `(4, 16)`;
            `(4, 0)` of a robot with one ray a sensor.
        length: of the rays aside [m], `(16,)` or `(0,)`.
    """

    middle: np.ndarray
    aside: np.ndarray
    length: np.ndarray


def room_for_rays(plan: Plan) -> Rays:
    """Room for the rays of a robot of this plan."""
    shape = plan.cones.rays.shape
    return Rays(np.empty(plan.rays.shape), np.empty(shape), np.empty(shape[1]))


@compiled(forceinline=True)
def place_rays(plan: Plan, own, i, rays: Rays):
    """Put the rays of robot `i`, whose sensors may be elsewhere, into their room.

    Returns:
        How far from the axle a ray begins at most [m].
    """
    outward = own[i, OUTWARD]
    n, middle, aside = plan.rays.shape[1], rays.middle, rays.aside
    for k in range(n):
        for row in range(4):
            middle[row, k] = plan.rays[row, k]
        middle[0, k] += outward * plan.rays[2, k]
        middle[1, k] += outward * plan.rays[3, k]
    # a sensor moves with all of its rays
    for k in range(aside.shape[1]):
        for row in range(4):
            aside[row, k] = plan.cones.rays[row, k]
        aside[0, k] += outward * plan.rays[2, k % n]
        aside[1, k] += outward * plan.rays[3, k % n]
    return plan.body.shell + max(outward, 0.0)


@compiled(forceinline=True)
def sense(plan: Plan, rays: Rays, edge, reach, state, i, distance):
    """What robot `i` senses where it stands.

    Args:
        plan: robot and arena.
        rays: of this robot.
        edge: how far from the axle they begin at most [m].
        reach: farthest that rays have to see [m].
        state: of all robots, `(n, N_STATE)`.
        i: number of the robot.
        distance: of what each sensor sees [m], -1 if nothing, `(8,)`; filled.
    """
    cast(rays.middle, edge, reach, plan.seen, state, i, distance)
    if rays.length.shape[0] > 0:
        cast(rays.aside, edge, reach, plan.seen, state, i, rays.length)
        widen(plan.cones.cosines, rays.length, distance)


@compiled(forceinline=True)
def move(body: Body, walls: Walls, state, i, own, left, right, n_substeps, substep):
    """Move robot `i` for a control step; whether its shell touched a wall.

    Args:
        body: numbers of the robot.
        walls: that its shell can touch.
        state: of all robots, `(n, N_STATE)`; changed.
        i: number of the robot.
        own: numbers of all robots, `(n, N_OWN)`; see `robots.own_numbers`.
        left: commanded speed of the left wheel [rad/s].
        right: of the right wheel.
        n_substeps: number of substeps.
        substep: duration of one [s].
    """
    ahead, around = 0.5 * (left + right), 0.5 * (right - left)
    turn = 2.0 * body.wheel_radius / body.track
    x, y, cos, sin = state[i, X], state[i, Y], state[i, COS], state[i, SIN]
    u, w, yaw = state[i, AHEAD], state[i, AROUND], state[i, YAW]
    left_ahead, time_ahead = own[i, LEFT_AHEAD], own[i, TIME_AHEAD]
    left_around, time_around = own[i, LEFT_AROUND], own[i, TIME_AROUND]
    radius = own[i, RADIUS]
    cell, touched = cell_of(walls.grid, x, y), False
    # how far it can go before it may touch anything
    free = distance_to(walls, cell, x, y) - radius
    for _ in range(n_substeps):
        way = body.wheel_radius * (ahead * substep + (u - ahead) * time_ahead)
        angle = turn * (around * substep + (w - around) * time_around)
        u = ahead + (u - ahead) * left_ahead
        w = around + (w - around) * left_around
        # half of the turn, the chord, the other half
        half = 0.5 * angle
        z = half * half
        sinc = 1.0 - z * (1 / 6 - z * (1 / 120 - z * (1 / 5040)))
        c = 1.0 - z * (0.5 - z * (1 / 24 - z * (1 / 720 - z * (1 / 40320))))
        s = half * sinc
        cos, sin = cos * c - sin * s, sin * c + cos * s
        x += way * sinc * cos
        y += way * sinc * sin
        cos, sin = cos * c - sin * s, sin * c + cos * s
        yaw += angle
        free -= abs(way)
        if free <= ROUNDING:
            free = distance_to(walls, cell, x, y) - radius
            if free <= 0.0:
                touched = True
                break
    scale = 1.0 / sqrt(cos * cos + sin * sin)
    state[i, X], state[i, Y], state[i, YAW] = x, y, yaw
    state[i, COS], state[i, SIN] = cos * scale, sin * scale
    state[i, AHEAD], state[i, AROUND] = u, w
    return touched


ROUNDING = 1e-12
"""Distance that may be lost by rounding [m]."""


@compiled()
def step_all(plan: Plan, rays: Rays, states, own, commands, time, reach, seen, contact):
    """One control step of robots `(n, N_STATE)`; fills `(n, 8)` and `(n,)`.

    `time` is the number of substeps and the duration of one [s].
    """
    for i in range(states.shape[0]):
        left, right = commands[i, 0], commands[i, 1]
        contact[i] = move(
            plan.body, plan.solid, states, i, own, left, right, time[0], time[1]
        )
    sense_all(plan, rays, states, own, reach, seen)


@compiled()
def touch_all(plan: Plan, states, own, contact):
    """Whether robots `(n, N_STATE)` touch a wall where they stand; fills `(n,)`."""
    for i in range(states.shape[0]):
        x, y = states[i, X], states[i, Y]
        far = distance_to(plan.solid, cell_of(plan.solid.grid, x, y), x, y)
        contact[i] = far <= own[i, RADIUS]


@compiled()
def sense_all(plan: Plan, rays: Rays, states, own, reach, seen):
    """What robots `(n, N_STATE)` sense where they stand; fills `(n, 8)`.

    Of their own numbers `(n, N_OWN)` only OUTWARD counts.
    """
    for i in range(states.shape[0]):
        edge = place_rays(plan, own, i, rays)
        sense(plan, rays, edge, reach, states, i, seen[i])
