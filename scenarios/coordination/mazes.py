#!/usr/bin/env python3
"""Prints a task of exploration in a maze; the number is its knob of hardness.

mazes.py hooks 3 > envs/hooks_3.ron        a puck in four corridors with three hooks each
mazes.py plugs 2 > envs/plugs_2.ron        the same, and each corridor is plugged by a block that must be pushed away first
mazes.py rods 3 > envs/rods_3.ron          a long rod in the place of the puck, which must be turned at each bend
mazes.py storeys 1 > envs/storeys_1.ron    a drone in a house with two halls, of one storey each above the ground floor
"""

import sys


def main() -> None:
    kind, size = sys.argv[1], int(sys.argv[2])
    print({"hooks": hooks, "plugs": plugs, "rods": rods, "storeys": storeys}[kind](size), end="")


Wall = tuple[float, float, float, float]  # x from, x to, y from, y to


def hooks(count: int) -> str:
    return corridors(
        count,
        HOOKS,
        description=f"Find the one of four corridors with {plural(count, 'hook')} that ends in a reward; each run draws it.",
    )


def plugs(count: int) -> str:
    """The first lane is longer than its opening: the block must be pushed into the pocket behind it."""
    end, top = (6.0, 6.5), 2 * count + 0.5
    walls = [wall for wall in walls_of_arm(count) if wall[:2] not in (end, (0.5, 6.0))]
    walls += [(0.5, 9.0, -1.0, -0.5), (6.0, 9.0, 0.5, 1.0), (6.0, 6.5, 1.0, top), (9.0, 9.5, -1.0, 1.0)]
    return corridors(
        count,
        PLUGS,
        description=f"Push a block out of the way, and find the one of four corridors with {plural(count, 'hook')} that ends in a reward; each run draws it.",
        iterations=4,
        steps=120 + 40 * (count + 1),
        walls=on_four_sides(walls),
        reach=f"{max(9, 2 * count + 0.5):g}",
        blocks=of_each_block(BLOCK),
        joints="    joints: [\n" + of_each_block(SLOT) + "    ],\n",
        places="        // How far each block was pushed, m.\n" + of_each_block('        (name: "block_%(side)d", type: JointPosition("slot_%(side)d")),\n'),
        seen=of_each_block('        (name: "block_%(side)d", unit: "m", range: (0.0, 4.0)),\n'),
    )


def rods(count: int) -> str:
    return corridors(
        count,
        RODS,
        description=f"Turn a rod through the bends of the one of four corridors with {plural(count, 'hook')} that ends in a reward; each run draws it.",
        goal=end_of_arm(count, depth=1.0),
        name="rod",
        body=ROD,
        places=ROD_PLACES,
        seen=ROD_SEEN,
        pushes='        (name: "turn", type: Signal, control: Continuous(-1.0, 1.0)),\n',
        start="0.1",
        starts='        (joint: "rod.angle", position: Uniform(-1.5707963, 1.5707963)),\n',
    )


def corridors(count: int, about: str, **parts: object) -> str:
    """With a puck, and without blocks, unless `parts` have others."""
    nothing = dict.fromkeys(("blocks", "joints", "places", "seen", "pushes", "starts"), "")
    usual: dict[str, object] = {
        "iterations": 2,
        "steps": 60 + 40 * (count + 1),
        "walls": on_four_sides(walls_of_arm(count)),
        "reach": f"{max(6, 2 * count + 0.5):g}",
        "goal": end_of_arm(count),
        "name": "puck",
        "body": PUCK,
        "start": "0.3",
    }
    about = filled(about, count=plural(count, "hook"))
    return filled(CORRIDORS, about=about, **{**nothing, **usual, **parts})


def of_each_block(line: str) -> str:
    places = [(4.3, 0, 0), (0, 4.3, 1.5707963), (-4.3, 0, 3.1415927), (0, -4.3, -1.5707963)]
    return "".join(line % {"side": side, "x": x, "y": y, "angle": angle} for side, (x, y, angle) in enumerate(places))


def storeys(count: int) -> str:
    """Floors have a hole of 1.2 m at the outer and at the inner end in turn."""
    height = 2.0 * count + 2.0
    walls = [(-5.5, 5.5, -0.5, 0.0), (-5.5, -5.0, 0.0, height), (5.0, 5.5, 0.0, height), (-5.5, 5.5, height, height + 0.5), (-0.2, 0.2, 2.0, height)]
    for floor in range(1, count + 1):
        left, right = (0.2, 3.8) if floor % 2 == 1 else (1.4, 5.0)
        walls += [(left, right, 2.0 * floor - 0.1, 2.0 * floor + 0.1), (-right, -left, 2.0 * floor - 0.1, 2.0 * floor + 0.1)]
    far = "ahead > 0 && ahead < 1.2" if count % 2 == 1 else "ahead > 3.8"
    return filled(
        STOREYS, count=plural(count, "storey"), steps=80 + 60 * (count + 1), walls=boxes(walls, friction=0.5), goal=f"y > {2 * count + 0.2:g} && {far}", height=f"{height:g}"
    )


def walls_of_arm(count: int) -> list[Wall]:
    """Walls of the corridor that begins to the east. Its lanes are 1 m wide and 2 m apart."""
    walls = [(0.5, 6.0, -1.0, -0.5)]
    for lane in range(count):
        low, high = 2 * lane + 0.5, 2 * lane + 1.5
        # The opening to the next lane is at the far end and at the near end in turn.
        walls.append((0.5 if lane == 0 else 1.5, 5.0, low, high) if lane % 2 == 0 else (3.0, 6.5, low, high))
    top = 2 * count + 0.5
    return [*walls, (6.0, 6.5, -1.0, top), (1.5, 2.0, 1.5, top), (1.5, 6.5, top, top + 0.5)]


def end_of_arm(count: int, depth: float = 0.5) -> str:
    """Whether the middle of the body is in the end of the last lane."""
    end = f"along > {6 - depth:g}" if count % 2 == 0 else f"along > 2 && along < {2 + depth:g}"
    return f"{end} && aside > {2 * count - 0.5:g} && aside < {2 * count + 0.5:g}"


def on_four_sides(walls: list[Wall]) -> str:
    return boxes([turned(wall, quarter) for quarter in range(4) for wall in walls], friction=0.0)


def turned(wall: Wall, quarters: int) -> Wall:
    left, right, low, high = wall
    for _ in range(quarters):
        left, right, low, high = -high, -low, left, right
    return left, right, low, high


def boxes(walls: list[Wall], friction: float) -> str:
    return "\n".join(box(wall, friction) for wall in walls)


def box(wall: Wall, friction: float) -> str:
    left, right, low, high = wall
    center = f"({(left + right) / 2:g}, {(low + high) / 2:g})"
    half_size = f"({(right - left) / 2:g}, {(high - low) / 2:g})"
    return f"        (geom: Box(center: {center}, half_size: {half_size}), friction: {friction}),"


def plural(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' if count > 1 else ''}"


def filled(text: str, **parts: object) -> str:
    return text % {"made": "scenarios/coordination/mazes.py writes the file", **parts}


HOOKS = """\
// Four equal corridors go out, aside and back: %(count)s in a row. One, which each run draws, ends in the reward, and nothing shows which. A push that
// does not depend on where the puck is sticks at a bend. The number of hooks is the knob of hardness; %(made)s.
"""

PLUGS = """\
// Four equal corridors with %(count)s, each of them plugged by a block that sticks: only a push of more than 2.5 N along the corridor moves it. It must be pushed over 2 m,
// past the bend and into a pocket behind it. One corridor, which each run draws, ends in the reward, and nothing shows which. The number of hooks behind the block is
// the knob of hardness; %(made)s.
"""

RODS = """\
// Four equal corridors go out, aside and back: %(count)s in a row. A rod, longer than the corridors are wide, must be turned at each bend. One corridor, which each run draws,
// ends in the reward, and nothing shows which. The number of hooks is the knob of hardness; %(made)s.
"""

PUCK = """\
        // A disc of 1 kg and 0.1 m, m r² / 2, with a drag of 2 N s/m: at most 2 m/s.
        (
            name: "puck",
            mass: 1.0,
            inertia: 0.005,
            colliders: [(name: "rim", geom: Ball(radius: 0.1), friction: 0.0)],
            forces: [(x: "-2 * x_dot", y: "-2 * y_dot")],
        ),
"""

ROD = """\
        // A rod of 1 kg and 1.2 m, m l² / 12, with drags of 2 N s/m and 0.25 N m s: at most 2 m/s and 2 rad/s.
        (
            name: "rod",
            mass: 1.0,
            inertia: 0.12,
            colliders: [(name: "rim", geom: Capsule(from: (-0.5, 0.0), to: (0.5, 0.0), radius: 0.1), friction: 0.0)],
            forces: [
                (x: "-2 * x_dot", y: "-2 * y_dot"),
                // A couple: the torque of `turn` against the drag.
                (y: "0.5 * turn - 0.25 * spin", at: (0.5, 0.0), frame: Local),
                (y: "-0.5 * turn + 0.25 * spin", at: (-0.5, 0.0), frame: Local),
            ],
        ),
"""

ROD_PLACES = """\
        // The rod has no front: half a turn leads to the same state.
        (name: "angle", type: JointPosition("rod.angle")),
        (name: "spin", type: JointVelocity("rod.angle")),
        (name: "turned_x", type: Formula("cos(2 * angle)")),
        (name: "turned_y", type: Formula("sin(2 * angle)")),
"""

ROD_SEEN = """\
        (name: "turned_x", range: (-1.0, 1.0)),
        (name: "turned_y", range: (-1.0, 1.0)),
        (name: "spin", unit: "rad/s", range: (-4.0, 4.0)),
"""

BLOCK = """\
        (name: "block_%(side)d", position: (%(x)g, %(y)g), angle: %(angle)g, mass: 1.0, inertia: 0.1, colliders: [(geom: Box(half_size: (0.4, 0.45)), friction: 0.0)]),
"""

SLOT = """\
        (name: "slot_%(side)d", parent: "world", child: "block_%(side)d", type: Slide(axis: (1.0, 0.0)), range: (0.0, 4.0), damping: 1.0, frictionloss: 2.5),
"""

CORRIDORS = """\
%(about)sEnvironment(
    description: "%(description)s",
    gravity: (0.0, 0.0),
    control_step: 0.1,
    time_limit: %(steps)d,
    reward_threshold: 0.5,
    solver: (iterations: %(iterations)d),
    // 0 east, counter-clockwise to 3 south.
    drawn_per_run: [(name: "goal", value: WholeNumber(from: 0, to: 3))],
    bodies: [
%(body)s%(blocks)s    ],
%(joints)s    colliders: [
%(walls)s
    ],
    actuators: [
        (name: "push_x", type: BodyForce(body: "%(name)s", direction: (1.0, 0.0)), gear: 4.0, control: Continuous(-1.0, 1.0)),
        (name: "push_y", type: BodyForce(body: "%(name)s", direction: (0.0, 1.0)), gear: 4.0, control: Continuous(-1.0, 1.0)),
%(pushes)s    ],
    sensors: [
        (name: "x", type: JointPosition("%(name)s.x")),
        (name: "y", type: JointPosition("%(name)s.y")),
        (name: "x_dot", type: JointVelocity("%(name)s.x")),
        (name: "y_dot", type: JointVelocity("%(name)s.y")),
        // Coordinates along the first lane of the right corridor, and to its left.
        (name: "along", type: Formula("cos(goal * pi / 2) * x + sin(goal * pi / 2) * y")),
        (name: "aside", type: Formula("cos(goal * pi / 2) * y - sin(goal * pi / 2) * x")),
%(places)s    ],
    observations: [
        (name: "x", unit: "m", range: (-%(reach)s, %(reach)s)),
        (name: "y", unit: "m", range: (-%(reach)s, %(reach)s)),
        (name: "x_dot", unit: "m/s", range: (-3.0, 3.0)),
        (name: "y_dot", unit: "m/s", range: (-3.0, 3.0)),
%(seen)s    ],
    reset: [
        (joint: "%(name)s.x", position: Uniform(-%(start)s, %(start)s)),
        (joint: "%(name)s.y", position: Uniform(-%(start)s, %(start)s)),
%(starts)s    ],
    reward: "if %(goal)s { 1 } else { 0 }",
    terminated: "%(goal)s",
)
"""

STOREYS = """\
// A drone in a house with two halls of %(count)s above a common ground floor. Each floor has a hole, at its outer and at its inner end in turn, so that the drone must fly back and
// forth to rise, and whatever does not hover falls. The reward is at the end of the uppermost storey of one hall, which each run draws; nothing shows which. The number of
// storeys is the knob of hardness; %(made)s.
Environment(
    description: "Fly up through the holes of a house with %(count)s, to the end of the hall that each run draws.",
    gravity: (0.0, -4.0),
    control_step: 0.1,
    time_limit: %(steps)d,
    reward_threshold: 0.5,
    solver: (iterations: 4),
    // 0 right, 1 left.
    drawn_per_run: [(name: "goal", value: WholeNumber(from: 0, to: 1))],
    bodies: [(
        name: "drone",
        position: (0.0, 0.2),
        mass: 1.0,
        inertia: 0.03,
        colliders: [(name: "hull", geom: Capsule(from: (-0.25, 0.0), to: (0.25, 0.0), radius: 0.1), friction: 0.5)],
        forces: [
            (x: "-0.5 * x_dot", y: "-0.5 * y_dot"),
            // Propellers only push: together at most twice the weight. White noise about 0 carries less than half of it.
            (y: "4 * (max(0, left) + max(0, right))", frame: Local),
            // A couple: the propellers turn the frame, and its keel turns it back.
            (y: "2 * (0.2 * (right - left) - 0.6 * angle - 0.12 * spin)", at: (0.25, 0.0), frame: Local),
            (y: "-2 * (0.2 * (right - left) - 0.6 * angle - 0.12 * spin)", at: (-0.25, 0.0), frame: Local),
        ],
    )],
    colliders: [
%(walls)s
    ],
    actuators: [
        (name: "left", type: Signal, control: Continuous(-1.0, 1.0)),
        (name: "right", type: Signal, control: Continuous(-1.0, 1.0)),
    ],
    sensors: [
        (name: "x", type: JointPosition("drone.x")),
        (name: "y", type: JointPosition("drone.y")),
        (name: "x_dot", type: JointVelocity("drone.x")),
        (name: "y_dot", type: JointVelocity("drone.y")),
        (name: "angle", type: JointPosition("drone.angle")),
        (name: "spin", type: JointVelocity("drone.angle")),
        (name: "ahead", type: Formula("(1 - 2 * goal) * x")),
    ],
    observations: [
        (name: "x", unit: "m", range: (-5.0, 5.0)),
        (name: "y", unit: "m", range: (0.0, %(height)s)),
        (name: "angle", unit: "rad", range: (-1.0, 1.0)),
        (name: "x_dot", unit: "m/s", range: (-4.0, 4.0)),
        (name: "y_dot", unit: "m/s", range: (-4.0, 4.0)),
        (name: "spin", unit: "rad/s", range: (-5.0, 5.0)),
    ],
    reset: [(joint: "drone.x", position: Uniform(-0.3, 0.3))],
    reward: "if %(goal)s { 1 } else { 0 }",
    terminated: "%(goal)s",
)
"""

if __name__ == "__main__":
    main()
