"""Compiled motion and rays of robots in a plan.

Wheels roll without slipping. Their speeds follow commands with a first-order lag, whose
distances and angles over a substep are exact; the path within one is the chord of a
circle. No function of the system's mathematical library is called, so that every
processor gives the same bits.
"""

from math import sqrt

import numpy as np

from epuck_mj.rungs.kinematic.compiling import compiled
from epuck_mj.rungs.kinematic.cones import widen
from epuck_mj.rungs.kinematic.plan import Body, Grid, Plan

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
def distance_to(first, near, sides, ellipses, cell, x, y):
    """Distance of a place from the outlines near its cell [m]; infinite without any."""
    least, n = np.inf, sides.shape[0]
    for k in range(first[cell], first[cell + 1]):
        i = near[k]
        if i < n:
            square = side_distance(sides, i, x, y)
        else:
            square = ellipse_distance(ellipses, i - n, x, y)
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
def sense(
    rays, shell, reach, grid: Grid, first, near, sides, ellipses, x, y, cos, sin, length
):
    """Lengths of a robot's rays `(n,)` [m]; -1 where nothing is within reach."""
    n, far = sides.shape[0], shell + reach
    for k in range(length.shape[0]):
        length[k] = np.inf
    cell = cell_of(grid, x, y)
    for m in range(first[cell], first[cell + 1]):
        i = near[m]
        if i >= n:
            cast_at_ellipse(rays, ellipses, i - n, x, y, cos, sin, length)
        elif side_distance(sides, i, x, y) <= far * far:
            cast_at_side(rays, sides, i, x, y, cos, sin, length)
    for k in range(length.shape[0]):
        length[k] = -1.0 if length[k] > reach else length[k]


@compiled(forceinline=True)
def rays_of(plan: Plan, own, i):
    """Rays of robot `i`, `(4, n)`, whose sensors may be elsewhere; and their reach.

    Nothing is farther from the axle than the second number where a ray begins [m].
    """
    outward = own[i, OUTWARD]
    rays = plan.rays.copy()
    for k in range(rays.shape[1]):
        rays[0, k] += outward * rays[2, k]
        rays[1, k] += outward * rays[3, k]
    return rays, plan.body.shell + max(outward, 0.0)


@compiled()
def aside_of(plan: Plan, own, i):
    """Rays of robot `i` to the left and right of the others, `(4, 16)`; none `(4, 0)`.

    A sensor moves with all of its rays.
    """
    outward = own[i, OUTWARD]
    aside, n = plan.cones.rays.copy(), plan.rays.shape[1]
    for k in range(aside.shape[1]):
        aside[0, k] += outward * plan.rays[2, k % n]
        aside[1, k] += outward * plan.rays[3, k % n]
    return aside


@compiled()
def sense_aside(plan: Plan, aside, shell, reach, states, i, length, distance):
    """Put what cones measure in the place of what their middle rays do [m].

    Args:
        plan: robot and arena.
        aside: rays of robot `i`, as of `aside_of`.
        shell: as of `rays_of`.
        reach: farthest that rays have to see [m].
        states: of all robots, `(n, N_STATE)`.
        i: number of the robot.
        length: room for the lengths of these rays, `(16,)`; changed.
        distance: lengths of the middle rays, `(8,)`; changed.
    """
    grid, first, near, sides, ellipses = plan.seen
    sense(
        aside,
        shell,
        reach,
        grid,
        first,
        near,
        sides,
        ellipses,
        states[i, X],
        states[i, Y],
        states[i, COS],
        states[i, SIN],
        length,
    )
    widen(plan.cones.cosines, length, distance)


@compiled(forceinline=True)
def move(
    body: Body,
    grid: Grid,
    first,
    near,
    sides,
    ellipses,
    state,
    i,
    own,
    left,
    right,
    n_substeps,
    substep,
):
    """Move robot `i` for a control step; whether its shell touched a wall.

    Args:
        body: numbers of the robot.
        grid: of what its shell can touch; see `Walls`.
        first: likewise.
        near: likewise.
        sides: likewise.
        ellipses: likewise.
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
    cell, touched = cell_of(grid, x, y), False
    # how far it can go before it may touch anything
    free = distance_to(first, near, sides, ellipses, cell, x, y) - radius
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
            free = distance_to(first, near, sides, ellipses, cell, x, y) - radius
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
def step_all(
    plan: Plan, states, own, commands, n_substeps, substep, reach, distance, contact
):
    """One control step of robots `(n, N_STATE)`; fills `(n, 8)` and `(n,)`."""
    grid, first, near, sides, ellipses = plan.solid
    for i in range(states.shape[0]):
        contact[i] = move(
            plan.body,
            grid,
            first,
            near,
            sides,
            ellipses,
            states,
            i,
            own,
            commands[i, 0],
            commands[i, 1],
            n_substeps,
            substep,
        )
    sense_all(plan, states, own, reach, distance)


@compiled()
def touch_all(plan: Plan, states, own, contact):
    """Whether robots `(n, N_STATE)` touch a wall where they stand; fills `(n,)`."""
    grid, first, near, sides, ellipses = plan.solid
    for i in range(states.shape[0]):
        x, y = states[i, X], states[i, Y]
        cell = cell_of(grid, x, y)
        far = distance_to(first, near, sides, ellipses, cell, x, y)
        contact[i] = far <= own[i, RADIUS]


@compiled()
def sense_all(plan: Plan, states, own, reach, distance):
    """What robots `(n, N_STATE)` sense where they stand; fills `(n, 8)`.

    Of their own numbers `(n, N_OWN)` only OUTWARD counts.
    """
    grid, first, near, sides, ellipses = plan.seen
    length = np.empty(plan.rays.shape[1])
    n_aside = plan.cones.rays.shape[1]
    beside = np.empty(n_aside)
    for i in range(states.shape[0]):
        rays, shell = rays_of(plan, own, i)
        sense(
            rays,
            shell,
            reach,
            grid,
            first,
            near,
            sides,
            ellipses,
            states[i, X],
            states[i, Y],
            states[i, COS],
            states[i, SIN],
            length,
        )
        if n_aside > 0:
            aside = aside_of(plan, own, i)
            sense_aside(plan, aside, shell, reach, states, i, beside, length)
        for k in range(length.shape[0]):
            distance[i, k] = length[k]
