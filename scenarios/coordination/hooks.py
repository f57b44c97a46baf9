#!/usr/bin/env python3
"""Prints a task of corridors with hooks: hooks.py 3 > envs/hooks_3.ron"""

import sys


def main() -> None:
    hooks = int(sys.argv[1])
    walls = walls_of_arm(hooks)
    boxes = "\n".join(box(turned(wall, quarter)) for quarter in range(4) for wall in walls)
    end = "along > 5.5" if hooks % 2 == 0 else "along > 2 && along < 2.5"
    goal = f"{end} && aside > {2 * hooks - 0.5:g} && aside < {2 * hooks + 0.5:g}"
    count = f"{hooks} hook{'s' if hooks > 1 else ''}"
    print(TASK % {"count": count, "limit": 300 + 50 * (hooks + 1), "boxes": boxes, "goal": goal, "reach": max(6.0, 2 * hooks + 0.5)})


def walls_of_arm(hooks: int) -> list[tuple[float, float, float, float]]:
    """Walls of the corridor that begins to the east: x from, x to, y from, y to. Its lanes are 1 m wide and 2 m apart."""
    walls = [(0.5, 6.0, -1.0, -0.5)]
    for lane in range(hooks):
        low, high = 2 * lane + 0.5, 2 * lane + 1.5
        # The opening to the next lane is at the far end and at the near end in turn.
        walls.append((0.5 if lane == 0 else 1.5, 5.0, low, high) if lane % 2 == 0 else (3.0, 6.5, low, high))
    top = 2 * hooks + 0.5
    return [*walls, (6.0, 6.5, -1.0, top), (1.5, 2.0, 1.5, top), (1.5, 6.5, top, top + 0.5)]


def turned(wall: tuple[float, float, float, float], quarters: int) -> tuple[float, float, float, float]:
    left, right, low, high = wall
    for _ in range(quarters):
        left, right, low, high = -high, -low, left, right
    return left, right, low, high


def box(wall: tuple[float, float, float, float]) -> str:
    left, right, low, high = wall
    center = f"({(left + right) / 2:g}, {(low + high) / 2:g})"
    half_size = f"({(right - left) / 2:g}, {(high - low) / 2:g})"
    return f"        (geom: Box(center: {center}, half_size: {half_size}), friction: 0.0),"


TASK = """\
// Four equal corridors go out, aside and back: %(count)s in a row. One, which each run draws, ends in the reward, and nothing shows which. A push that
// does not depend on where the puck is sticks at a bend. The number of hooks is the knob of hardness; scenarios/coordination/hooks.py writes the file.
Environment(
    description: "Find the one of four corridors with %(count)s that ends in a reward; each run draws it.",
    gravity: (0.0, 0.0),
    control_step: 0.05,
    time_limit: %(limit)d,
    reward_threshold: 0.5,
    solver: (iterations: 2),
    // 0 east, counter-clockwise to 3 south.
    drawn_per_run: [(name: "goal", value: WholeNumber(from: 0, to: 3))],
    bodies: [
        // A disc of 1 kg and 0.1 m, m r² / 2, with a drag of 1 N s/m.
        (
            name: "puck",
            mass: 1.0,
            inertia: 0.005,
            colliders: [(name: "rim", geom: Ball(radius: 0.1), friction: 0.0)],
            forces: [(x: "-x_dot", y: "-y_dot")],
        ),
    ],
    colliders: [
%(boxes)s
    ],
    actuators: [
        (name: "push_x", type: BodyForce(body: "puck", direction: (1.0, 0.0)), gear: 2.0, control: Continuous(-1.0, 1.0)),
        (name: "push_y", type: BodyForce(body: "puck", direction: (0.0, 1.0)), gear: 2.0, control: Continuous(-1.0, 1.0)),
    ],
    sensors: [
        (name: "x", type: JointPosition("puck.x")),
        (name: "y", type: JointPosition("puck.y")),
        (name: "x_dot", type: JointVelocity("puck.x")),
        (name: "y_dot", type: JointVelocity("puck.y")),
        // Coordinates along the first lane of the right corridor, and to its left.
        (name: "along", type: Formula("cos(goal * pi / 2) * x + sin(goal * pi / 2) * y")),
        (name: "aside", type: Formula("cos(goal * pi / 2) * y - sin(goal * pi / 2) * x")),
    ],
    observations: [
        (name: "x", unit: "m", range: (-%(reach)s, %(reach)s)),
        (name: "y", unit: "m", range: (-%(reach)s, %(reach)s)),
        (name: "x_dot", unit: "m/s", range: (-3.0, 3.0)),
        (name: "y_dot", unit: "m/s", range: (-3.0, 3.0)),
    ],
    reset: [
        (joint: "puck.x", position: Uniform(-0.3, 0.3)),
        (joint: "puck.y", position: Uniform(-0.3, 0.3)),
    ],
    reward: "if %(goal)s { 1 } else { 0 }",
    terminated: "%(goal)s",
)"""

if __name__ == "__main__":
    main()
