"""Tasks that are converted from MJCF: their text, their errors, and their motion beside MuJoCo's."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest

import seedbed
from seedbed.import_mjcf import MjcfError, convert
from seedbed.import_mjcf.__main__ import main
from seedbed.import_mjcf.bodies import Body
from seedbed.import_mjcf.comparison import (
    Motion,
    Start,
    motion,
    mujoco_motion,
    random_controls,
    reference_start,
    without_constraints,
)
from seedbed.import_mjcf.conversion import Conversion, Options, convert_model
from seedbed.import_mjcf.plane import Array

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"

FRAME_SKIPS = {
    "inverted_pendulum": 2,
    "inverted_double_pendulum": 5,
    "reacher": 2,
    "hopper": 4,
    "walker2d": 4,
    "walker2d_v5": 4,
    "half_cheetah": 5,
    "swimmer": 4,
}
"""Gymnasium's planar models, with the time steps per control step of its environments."""

Write = Callable[[str], Path]


@pytest.fixture
def model(tmp_path: Path) -> Write:
    """Writes the inner part of an MJCF file, and returns its path."""

    def write(text: str) -> Path:
        path = tmp_path / "model.xml"
        path.write_text(f'<mujoco model="test">{text}</mujoco>')
        return path

    return write


def errors_of(path: Path) -> list[str]:
    with pytest.raises(MjcfError) as raised:
        convert(path)
    return raised.value.messages


# Text

CART = """
<option timestep="0.01"/>
<worldbody>
  <geom name="rail" type="capsule" fromto="-1 0 0 1 0 0" size="0.02" contype="0" conaffinity="0"/>
  <body name="cart" pos="0 0 0.5">
    <joint name="x" type="slide" axis="1 0 0" range="-1 1" limited="true" ref="0.25"/>
    <inertial pos="0 0 0" mass="6" diaginertia="0.03 0.025 0.03"/>
    <geom type="box" size="0.1 0.2 0.05" contype="0" conaffinity="0"/>
    <body name="pole" pos="0 0 0.1">
      <joint name="turn" axis="0 1 0" damping="0.1" armature="0.01"/>
      <inertial pos="0.2 0 0" mass="0.5" diaginertia="0.1 0.2 0.3"/>
    </body>
  </body>
</worldbody>
<actuator><motor joint="x" gear="10" ctrlrange="-2 2" ctrllimited="true"/></actuator>
"""

CART_TASK = """Environment(
    description: "The model test, converted from MJCF.",
    // option: gravity
    gravity: (0.0, -9.81),
    // option: timestep 0.01, times 3 (--frame-skip)
    control_step: 0.03,
    // --time-limit
    time_limit: 200,
    solver: (iterations: 24, passes: 2, searches: 1),
    // Geoms that do not move and touch nothing: geom rail
    scenery: [Capsule(from: (-1.0, 0.0), to: (1.0, 0.0), radius: 0.02)],
    // position, angle: body pos, quat at the reference pose; mass, com, inertia: from inertial or from the geoms, as MuJoCo does
    bodies: [
        // body "cart": pos, quat, inertial; geom 1 (unnamed)
        (name: "cart", position: (0.0, 0.5), mass: 6.0, com: (0.0, 0.0), inertia: 0.025, geoms: [Box(half_size: (0.1, 0.05))]),
        // body "pole": pos, quat, inertial; no geoms
        (name: "pole", position: (0.0, 0.6), mass: 0.5, com: (0.2, 0.0), inertia: 0.2),
    ],
    // axis, pos, range, damping, frictionloss, armature, stiffness, springref; bodies without joints are parts of others
    // range_softness: solreflimit, solimplimit, as a spring that yields as far to a lasting force and recovers as fast
    joints: [
        (
            name: "x",
            parent: "world",
            child: "cart",
            type: Slide(axis: (1.0, 0.0)),
            range: (-1.25, 0.75),
            range_softness: (natural_frequency: 35.58812717085883, damping_ratio: 2.2360679774997885),
        ),
        (name: "turn", parent: "cart", child: "pole", type: Hinge(positive: Clockwise), damping: 0.1, armature: 0.01),
    ],
    // gear, gainprm, biasprm, ctrlrange of actuators
    actuators: [(name: "x_force", type: JointForce("x"), gear: 10.0, control: Continuous(-2.0, 2.0))],
    sensors: [
        (name: "x_offset", type: JointPosition("x")),
        (name: "x", type: Formula("x_offset + 0.25")),
        (name: "x_dot", type: JointVelocity("x")),
        (name: "turn", type: JointPosition("turn")),
        (name: "turn_dot", type: JointVelocity("turn")),
    ],
    observations: [
        (name: "x", unit: "m", range: (-1.0, 1.0)),
        (name: "turn", unit: "rad", range: (-3.141592653589793, 3.141592653589793)),
        (name: "x_dot", unit: "m/s", range: (-10.0, 10.0)),
        (name: "turn_dot", unit: "rad/s", range: (-10.0, 10.0)),
    ],
    // At rest in the reference pose, where its coordinates are in their ranges.
    // Positions count from the reference pose, unlike the sensors; x: 0 is 0.25 of MJCF.
    reset: [],
    // Nothing is rewarded yet.
    reward: "0",
)
"""


def test_text_of_a_cart(model: Write) -> None:
    text = convert(model(CART), frame_skip=3, time_limit=200)
    header, separator, task = text.partition("Environment(")
    assert separator + task == CART_TASK
    assert header.startswith(
        f"// Converted from model.xml by `python -m seedbed.import_mjcf`; read by MuJoCo {mujoco.__version__}.\n"
    )
    assert "// Time: timestep 0.01 s with the integrator Euler, 3 per control step.\n" in header


@pytest.mark.parametrize("name", FRAME_SKIPS)
def test_gymnasium_models_become_correct_tasks(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.ron"
    path.write_text(convert(ASSETS / f"{name}.xml", FRAME_SKIPS[name]))
    task = seedbed.Task(path)
    reference = mujoco.MjModel.from_xml_path(str(ASSETS / f"{name}.xml"))
    assert len(task.observations) == reference.nq + reference.nv
    assert [action.range for action in task.actions] == [tuple(limits) for limits in reference.actuator_ctrlrange]
    assert task.control_step == pytest.approx(reference.opt.timestep * FRAME_SKIPS[name])


@pytest.mark.parametrize("name", FRAME_SKIPS)
def test_masses_are_those_of_mujoco(name: str) -> None:
    conversion = convert_model(ASSETS / f"{name}.xml", Options())
    mass = sum(body.mass for body in conversion.bodies.bodies.values())
    assert mass == pytest.approx(conversion.source.model.body_mass.sum(), rel=1e-12)


def test_names_are_valid_and_unique(model: Write) -> None:
    text = convert(
        model("""
        <worldbody>
          <body name="left arm"><joint name="box" axis="0 1 0"/><geom size="0.1"/>
            <body name="left-arm" pos="1 0 0"><joint name="2nd" axis="0 1 0"/><geom size="0.1"/></body>
          </body>
        </worldbody>
        <actuator><motor name="box" joint="box" ctrlrange="-1 1" ctrllimited="true"/></actuator>""")
    )
    for expected in ('name: "left_arm"', 'name: "left_arm_2"', 'name: "box_"', 'name: "_2nd"', 'name: "box_torque"'):
        assert expected in text


# Errors


def test_a_model_in_space_names_all_joints_that_are_not_planar() -> None:
    hinge = "expected a hinge about the axis z of the world, about which most hinges turn"
    axes = {1: "-0.7071 0.7071 0", 2: "0.7071 0.7071 0", 3: "-0.7071 0.7071 0", 4: "0.7071 0.7071 0"}
    ankles = [
        f'ant.xml: joint "ankle_{number}": its axis is {axis} in the world: {hinge}' for number, axis in axes.items()
    ]
    free = (
        'ant.xml: joint "root": type="free" is not planar: expected type="slide" or type="hinge"; a body that is free in a '
        "plane has two slides, then a hinge"
    )
    assert errors_of(ASSETS / "ant.xml") == [free, *ankles]


@pytest.mark.parametrize("name", ["humanoid", "humanoidstandup", "pusher_v5"])
def test_other_models_in_space_are_errors(name: str) -> None:
    messages = errors_of(ASSETS / f"{name}.xml")
    assert len(messages) > 5
    assert all(message.startswith(f"{name}.xml: ") for message in messages)


def test_all_errors_are_listed_at_once(model: Write) -> None:
    path = model("""
        <option density="1" wind="1 0 0"/>
        <worldbody>
          <body name="a">
            <joint name="a1" axis="0 1 0"/><joint name="a2" axis="0 1 0" pos="1 0 0"/>
            <geom name="egg" type="ellipsoid" size="0.1 0.2 0.3"/>
            <body name="b" pos="1 0 0" gravcomp="1"><joint name="b1" axis="0 1 0"/><geom name="ball" size="0.1"/></body>
          </body>
          <body name="c" pos="0 0 2"><joint name="c1" axis="0 1 0"/><geom name="other" size="0.1"/></body>
        </worldbody>
        <equality><joint name="same" joint1="a1" joint2="b1"/></equality>
        <actuator>
          <motor name="strong" joint="a1"/>
          <motor name="weak" joint="a1" ctrlrange="-1 1" ctrllimited="true" forcerange="-0.5 0.5" forcelimited="true"/>
          <general name="slow" joint="b1" ctrlrange="-1 1" ctrllimited="true" dyntype="filter" dynprm="0.1"/>
          <adhesion name="glue" body="c" ctrlrange="0 1"/>
        </actuator>""")
    assert errors_of(path) == [
        'model.xml: equality joint "same": constraints between coordinates or bodies are not expressible: expected to leave it out',
        "model.xml: option: wind is not expressible: expected 0",
        'model.xml: body "b": gravcomp="1" is not expressible: expected 0',
        'model.xml: body "a": its joints joint "a1", joint "a2" are hinge, hinge: expected up to two slides, then at most one hinge',
        'model.xml: geom "egg": type="ellipsoid" of a geom that can touch others: expected type="sphere", "capsule", '
        '"cylinder", "box" or "plane", or contype="0" conaffinity="0"',
        'model.xml: actuator "strong": its control is not limited: expected a ctrlrange="LOW HIGH"',
        'model.xml: actuator "weak": forcerange="-0.5 0.5" limits the force of a motor: expected a ctrlrange that does not exceed it',
        'model.xml: actuator "slow": dyntype="filter": activations are not expressible, expected "none"',
        'model.xml: actuator "glue": it acts on a body: expected a joint, or a <fixed> tendon',
    ]


def test_a_wall_beside_the_plane_must_not_be_touched(model: Write) -> None:
    text = """
        <worldbody>
          <geom name="wall" type="plane" size="1 1 1"/>
          <body name="disc" pos="0 0 {height}">
            <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
            <geom name="rim" size="0.1"/>
          </body>
        </worldbody>"""
    assert errors_of(model(text.format(height=0.09))) == [
        'model.xml: geom "wall": it always touches geom "rim": expected a distance perpendicular to the plane of the model'
    ]
    assert "it is parallel to the plane of the model" in convert(model(text.format(height=0.1)))


def test_a_pair_with_another_friction_is_an_error(model: Write) -> None:
    path = model("""
        <worldbody>
          <geom name="floor" type="plane" size="1 1 1" friction="0.5" priority="1"/>
          <body name="a" pos="0 0 1"><joint type="slide" axis="0 0 1"/><geom name="rim" size="0.1"/></body>
          <body name="b" pos="0 0 2"><joint type="slide" axis="0 0 1"/><geom name="other" size="0.1" friction="0.2"/></body>
        </worldbody>""")
    assert errors_of(path) == [
        'model.xml: geom "floor": its contact with geom "rim" has the friction 0.5, but the larger one of the two surfaces\' is 1: '
        "expected no priority, and no <pair> with another friction"
    ]


def test_the_program_writes_nothing_if_there_are_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(ASSETS / "ant.xml")]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("error: ant.xml: ") == 5


@pytest.mark.parametrize(
    ("content", "expected"), [(None, "there is no such file"), ("<mujoco><body></mujoco>", "MuJoCo cannot read it: ")]
)
def test_files_that_cannot_be_read(content: str | None, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "model.xml"
    if content:
        path.write_text(content)
    [message] = errors_of(path)
    assert message.startswith(f"{path}: {expected}")


def test_a_folder_is_no_model(tmp_path: Path) -> None:
    assert errors_of(tmp_path) == [f"{tmp_path}: expected an MJCF file, found a folder"]


def test_mujoco_is_optional(model: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    [message] = errors_of(model(CART))
    assert message == "the package `mujoco` is needed to read MJCF files: pip install mujoco"


# The command


def test_the_command_writes_the_file_and_compares(model: Write, tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "seedbed.import_mjcf",
        model(CART),
        "--frame-skip",
        "3",
        "-o",
        tmp_path / "cart.ron",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == ""
    assert seedbed.Task(tmp_path / "cart.ron").control_step == pytest.approx(0.03)
    lines = done.stderr.splitlines()
    assert lines[0].startswith("Largest differences from MuJoCo within 1, 10, 100 control steps of random controls")
    assert [line.split("  ")[0] for line in lines[2:6]] == [
        "the model as it is",
        *[f"ranges, contacts and ropes off, {factor} x iterations" for factor in (1, 2, 4)],
    ]


def test_the_comparison_names_joints_whose_error_may_not_shrink(model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    pole = 'damping="0.1" stiffness="2" frictionloss="0.5" range="-90 90" limited="true"'
    servo = '<actuator><position joint="x" kp="1" ctrlrange="-1 1"/>'
    assert main([str(model(CART.replace('damping="0.1"', pole).replace("<actuator>", servo)))]) == 0
    rubbing, wrapping = capsys.readouterr().err.splitlines()[-2:]
    assert rubbing.startswith("(frictionloss of turn: ")
    assert wrapping.startswith("(turn: without ranges ")


def test_the_task_goes_to_standard_output(model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(model(CART)), "--no-comparison", "--time-limit", "7"]) == 0
    output = capsys.readouterr()
    assert output.err == ""
    assert "    time_limit: 7,\n" in output.out


def test_files_are_replaced_only_on_request(model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    path = model(CART)
    text = path.read_text()
    assert main([str(path), "--no-comparison", "-o", str(path)]) == 2
    assert capsys.readouterr().err == f"error: {path}: there is such a file: expected another name, or --overwrite to replace it\n"
    assert path.read_text() == text
    assert main([str(path), "--no-comparison", "--overwrite", "-o", str(path)]) == 0
    assert path.read_text().startswith("// Converted from model.xml")


def test_the_folder_of_the_file_is_made_before_the_work(model: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = model(CART)
    out = tmp_path / "envs" / "more" / "cart.ron"
    assert main([str(path), "--no-comparison", "-o", str(out)]) == 0
    assert out.read_text().startswith("// Converted from model.xml")
    capsys.readouterr()
    below_a_file = path / "cart.ron"
    assert main(["no.xml", "--no-comparison", "-o", str(below_a_file)]) == 2
    assert capsys.readouterr().err == f"error: {below_a_file}: its folder cannot be made: File exists\n"
    assert main(["no.xml", "--no-comparison", "-o", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"error: {tmp_path}: expected the name of a file, found a folder\n"


@pytest.mark.parametrize("arguments", [[], ["--no-comparison"]])
def test_a_file_that_is_not_correct_is_not_written(arguments: list[str], model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    negative = model(CART.replace('damping="0.1"', 'damping="-1"'))
    assert main([str(negative), *arguments]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert "error: model.xml: the converted file is not correct: model.ron:" in output.err
    assert "in `joints[1].damping`: expected a number of at least 0" in output.err


def test_what_is_left_out_is_reported_and_written(model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    friction = 'damping="0.1" frictionloss="1" solreffriction="0.5 1" solimpfriction="0.5 0.6 0.1"'
    text = CART.replace('damping="0.1"', friction) + '<keyframe><key name="up" qpos="0.25 1"/><key qpos="0 0"/></keyframe>'
    path = model(text + '<sensor><jointpos name="angle" joint="turn"/></sensor>')
    assert main([str(path), "--no-comparison"]) == 0
    output = capsys.readouterr()
    assert output.err.splitlines() == [
        'warning: model.xml: joint "turn": solreffriction is left out',
        'warning: model.xml: joint "turn": solimpfriction is left out',
        "left out: model.xml: the sensors angle",
        "left out: model.xml: the keyframes up, (unnamed)",
    ]
    assert '// Changed: joint "turn": solreffriction is left out.\n' in output.out
    assert "// Left out: the keyframes up, (unnamed).\n" in output.out


FLOOR = """
<option cone="elliptic" impratio="10"/>
<worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="a&#13;b" pos="0 0 1"><joint type="slide" axis="0 0 1"/><geom name="ball&#13;)" size="0.1"/></body>
</worldbody>
"""


def test_targets_in_degrees_and_taut_ropes_are_reported(model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    text = CART.replace("<actuator>", '<actuator><position joint="turn" kp="1" ctrlrange="-90 90"/>')
    text = text.replace('<geom name="rail"', '<site name="hook" pos="0 0 3"/><geom name="rail"')
    text = text.replace('<body name="pole"', '<site name="eye"/><body name="pole"')
    rope = '<tendon><spatial name="rope" limited="true" range="0 2"><site site="hook"/><site site="eye"/></spatial></tendon>'
    assert main([str(model(text + rope)), "--no-comparison"]) == 0
    assert capsys.readouterr().err.splitlines() == [
        "warning: model.xml: actuator 0 (unnamed): its target goes to 90 rad: MuJoCo does not convert ctrlrange from degrees",
        'warning: model.xml: tendon "rope": it is taut in the reference pose, in which its sites are 0.5 m too far apart',
    ]


def test_options_of_contacts_are_left_out(model: Write) -> None:
    assert '// Left out: option cone="elliptic", of MuJoCo\'s contacts.\n// Left out: option impratio="10",' in convert(model(FLOOR))


def test_names_do_not_end_comments(model: Write) -> None:
    assert "\r" not in convert(model(FLOOR))


@pytest.mark.parametrize("arguments", [["--frame-skip", "0"], ["--time-limit", "x"], ["-o", "."]])
def test_wrong_arguments(arguments: list[str], model: Write, capsys: pytest.CaptureFixture[str]) -> None:
    try:
        code: object = main([str(model(CART)), "--no-comparison", *arguments])
    except SystemExit as exit_of_parser:
        code = exit_of_parser.code
    assert code == 2
    assert "error: " in capsys.readouterr().err


# What touches what


def pairs_of(text: str, model: Write) -> set[frozenset[str]]:
    """Names of the colliders that can touch each other by the groups of the task file."""
    conversion = convert_model(model(text), Options())
    surfaces = {conversion.source.name("geom", geom): surface for geom, surface in conversion.contacts.surfaces.items()}
    return {
        frozenset((first, second))
        for first, one in surfaces.items()
        for second, other in surfaces.items()
        if first < second and (one.contype & other.conaffinity or other.contype & one.conaffinity)
    }


DISCS = """
    <worldbody>
      <geom name="floor" type="plane" size="1 1 1" contype="1" conaffinity="1"/>
      <body name="a" pos="0 {depth} 1"><joint type="slide" axis="0 0 1"/><geom name="a" size="0.1" {groups}/></body>
      <body name="b" pos="0 0 2"><joint type="slide" axis="0 0 1"/><geom name="b" size="0.1"/></body>
      <body name="c" pos="0 0 3"><joint type="slide" axis="0 0 1"/><geom name="c" size="0.1"/></body>
    </worldbody>
    <contact>{contact}</contact>"""

ALL_PAIRS = {"floor a", "floor b", "floor c", "a b", "a c", "b c"}


@pytest.mark.parametrize(
    ("depth", "groups", "contact", "missing"),
    [
        (0, "", "", set()),
        (0, "", '<exclude body1="a" body2="b"/>', {"a b"}),
        (0.3, "", "", {"a b", "a c"}),
        (0, 'contype="0" conaffinity="0"', "", {"floor a", "a b", "a c"}),
        (0, 'contype="0" conaffinity="0"', '<pair geom1="a" geom2="floor"/>', {"a b", "a c"}),
        (0.3, "", '<exclude body1="a" body2="world"/><exclude body1="b" body2="c"/>', {"a b", "a c", "floor a", "b c"}),
    ],
)
def test_groups_reproduce_who_can_touch_whom(
    depth: float, groups: str, contact: str, missing: set[str], model: Write
) -> None:
    expected = {frozenset(pair.split()) for pair in ALL_PAIRS - missing}
    assert pairs_of(DISCS.format(depth=depth, groups=groups, contact=contact), model) == expected


def test_what_is_out_of_reach_is_only_drawn(model: Write) -> None:
    text = """
        <worldbody>
          <geom name="floor" type="plane" size="1 1 1"/>
          <body name="arm" pos="0 0 {height}"><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.1"/></body>
        </worldbody>"""
    assert "colliders" not in convert(model(text.format(height=1)))
    assert "colliders" in convert(model(text.format(height=0.5)))


# Motion


def refined(conversion: Conversion, factor: int) -> Conversion:
    return replace(conversion, options=replace(conversion.options, refinement=factor))


def free_motions(path: Path, frame_skip: int, steps: int, start: Start | None = None) -> tuple[list[Motion], Motion]:
    """Motions without contacts and ranges with one, two and four times the iterations, and MuJoCo's with short steps."""
    conversion = convert_model(path, Options(frame_skip))
    controls = random_controls(conversion, steps)
    start = start or reference_start(conversion)
    free = without_constraints(conversion)
    ours = [motion(refined(free, factor), start, controls) for factor in (1, 2, 4)]
    return ours, mujoco_motion(conversion, start, controls, is_free=True)


@pytest.mark.parametrize("name", FRAME_SKIPS)
def test_motion_converges_to_that_of_mujoco(name: str) -> None:
    """Ten control steps of random controls, contacts and ranges off: errors of first order, at most 6 mrad or mm."""
    ours, theirs = free_motions(ASSETS / f"{name}.xml", FRAME_SKIPS[name], 10)
    errors = [one.differences(theirs, 10)[0] for one in ours]
    assert errors[2] < 6e-3
    assert errors[1] < 0.6 * errors[0]
    assert errors[2] < 0.6 * errors[1]


LINKS = """
    <compiler angle="radian"/>
    <option timestep="0.005" gravity="1 2 -3"/>
    <default><geom contype="0" conaffinity="0"/></default>
    <worldbody>
      <body name="upper" pos="0.1 0.2 0.3" {turn}>
        <joint name="first" axis="{axis}" pos="0.05 0.05 0.05" stiffness="2" springref="0.5" ref="0.2" damping="0.01"/>
        <geom type="capsule" fromto="0 0 0 {end}" size="0.05"/>
        <body name="lower" pos="{end}">
          <joint name="second" axis="{negative}" damping="0.02" ref="-0.1"/>
          <geom type="box" pos="{end}" size="0.1 0.2 0.3" mass="0.7"/>
          <body name="tip" pos="{end}"><geom size="0.1" mass="0.2"/></body>
        </body>
      </body>
    </worldbody>
    <actuator>
      <motor joint="first" gear="3" ctrlrange="-1 1" ctrllimited="true"/>
      <position joint="second" kp="5" kv="0.5" ctrlrange="-1 1" ctrllimited="true"/>
    </actuator>"""

PLANES = {
    "x": ("1 0 0", "-1 0 0", "0 0.3 0.4"),
    "y": ("0 1 0", "0 -1 0", "0.4 0 0.3"),
    "z": ("0 0 1", "0 0 -1", "0.3 0.4 0"),
}


@pytest.mark.parametrize("normal", PLANES)
def test_two_links_in_all_planes_from_another_state(normal: str, model: Write) -> None:
    """Springs, references, servos and welds: 20 control steps, at most 4 mrad with four times the iterations."""
    axis, negative, end = PLANES[normal]
    path = model(LINKS.format(axis=axis, negative=negative, end=end, turn=""))
    ours, theirs = free_motions(path, 2, 20, Start({"first": 0.3, "second": -0.7}, {"first": 1.0, "second": -2.0}))
    errors = [one.differences(theirs, 20)[0] for one in ours]
    assert errors[2] < 4e-3
    assert errors[2] < 0.6 * errors[1] < 0.36 * errors[0]


@pytest.mark.parametrize("turn", ["0 0.5 0", "0 0 3.141592653589793", "1.5707963267948966 0 0"])
def test_turned_frames_of_bodies(turn: str, model: Write) -> None:
    """A body's frame may be turned in any way, as long as its joints are planar: the same motion as MuJoCo's."""
    path = model(f"""
        <compiler angle="radian"/>
        <default><geom contype="0" conaffinity="0"/></default>
        <worldbody>
          <body name="holder" euler="{turn}">
            <body name="arm" pos="0.2 0.1 0.3">
              <joint name="turn" axis="{rotated(turn, (0, 1, 0))}"/>
              <geom type="capsule" fromto="0 0 0 {rotated(turn, (0.5, 0, 0.2))}" size="0.05"/>
            </body>
          </body>
        </worldbody>
        <actuator><motor joint="turn" ctrlrange="-1 1" ctrllimited="true"/></actuator>""")
    ours, theirs = free_motions(path, 5, 20, Start({"turn": 0.3}, {"turn": 1.0}))
    assert ours[2].differences(theirs, 20)[0] < 3e-3


def rotated(euler: str, vector: tuple[float, float, float]) -> str:
    """A vector of the world in a frame that is turned by angles about x, y and z, of which one is not 0."""
    quaternion, result = np.zeros(4), np.zeros(3)
    mujoco.mju_euler2Quat(quaternion, np.array([float(angle) for angle in euler.split()]), "xyz")
    mujoco.mju_negQuat(quaternion, quaternion)
    mujoco.mju_rotVecQuat(result, np.array(vector, dtype=float), quaternion)
    return " ".join(repr(float(value)) for value in result)


def test_forces_of_tendons(model: Write) -> None:
    path = model("""
        <option gravity="0 0 0"/>
        <default><geom contype="0" conaffinity="0"/></default>
        <worldbody>
          <body name="mass"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
          <geom size="0.1" mass="0.3"/></body>
        </worldbody>
        <tendon><fixed name="both"><joint joint="x" coef="0.5"/><joint joint="y" coef="-2"/></fixed></tendon>
        <actuator><motor name="pull" tendon="both" gear="3" ctrlrange="-1 1" ctrllimited="true"/></actuator>""")
    assert 'force: "1.5 * pull"' in convert(path)
    assert 'force: "-6.0 * pull"' in convert(path)
    ours, theirs = free_motions(path, 5, 20)
    assert ours[2].differences(theirs, 20)[0] < 1e-3


def test_a_string_between_two_sites_is_a_rope(model: Write) -> None:
    text = convert(
        model("""
        <worldbody>
          <site name="hook" pos="0 0.3 1"/>
          <body name="weight" pos="0 0 0.6">
            <joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
            <geom size="0.1"/><site name="eye" pos="0 0 0.1"/>
          </body>
        </worldbody>
        <tendon><spatial name="string" limited="true" range="0 0.5"><site site="hook"/><site site="eye"/></spatial></tendon>""")
    )
    rope = '(name: "string", from: (body: "world", at: (0.0, 1.0)), to: (body: "weight", at: (0.0, 0.1)), length: 0.4)'
    assert f"ropes: [{rope}]," in text


def test_bodies_in_a_fluid_are_boxes(model: Write) -> None:
    """The box of MuJoCo's fluid is that of the geom, along the axes of the body's frame in the task file."""
    text = convert(
        model("""
        <option density="1000" viscosity="0.1" gravity="0 0 0"/>
        <worldbody>
          <body name="fish">
            <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/><joint name="turn" axis="0 0 1"/>
            <geom type="box" size="0.2 0.05 0.1" euler="0 0 30" contype="0" conaffinity="0"/>
          </body>
        </worldbody>""")
    )
    assert "fluid: (density: 1000.0, viscosity: 0.1)" in text
    [box] = [line for line in text.splitlines() if "fluid_box" in line]
    sides = [float(side) for side in box.strip().removeprefix("fluid_box: (").removesuffix("),").split(", ")]
    assert sides == pytest.approx([0.4, 0.1, 0.2]) or sides == pytest.approx([0.1, 0.4, 0.2])
    assert "Box(half_size: " in text


def test_the_end_of_a_range_yields_as_in_mujoco(model: Write) -> None:
    """A lasting force pushes a slide as far beyond its range as in MuJoCo, within 2 percent."""
    path = model("""
        <option gravity="0 0 0"/>
        <default><geom contype="0" conaffinity="0"/></default>
        <worldbody>
          <body name="mass"><joint name="x" type="slide" axis="1 0 0" range="-1 0.1" limited="true" solreflimit="0.03 1"/>
          <geom size="0.1" mass="1"/></body>
        </worldbody>
        <actuator><motor joint="x" gear="100" ctrlrange="0.999 1" ctrllimited="true"/></actuator>""")
    conversion = convert_model(path, Options(frame_skip=5))
    controls, start = random_controls(conversion, 200), Start({}, {})
    ours, theirs = motion(conversion, start, controls), mujoco_motion(conversion, start, controls)
    assert theirs.positions[-1, 0] - 0.1 == pytest.approx(100 * 0.03**2 * 0.05, rel=0.02)
    assert ours.positions[-1, 0] - 0.1 == pytest.approx(theirs.positions[-1, 0] - 0.1, rel=0.02)


def test_start_poses_that_need_attention_are_warnings(model: Write) -> None:
    path = model("""
        <worldbody>
          <geom name="floor" type="plane" size="1 1 1"/>
          <body name="leg" pos="0 0 0.3">
            <joint name="knee" axis="0 1 0" range="10 90" limited="true"/><geom name="shin" size="0.4"/>
          </body>
        </worldbody>""")
    conversion = convert_model(path, Options())
    assert conversion.source.report.warnings == [
        'joint "knee": the reference pose is outside of its range: episodes start at its nearest end, 0.174533',
        'geom "floor": it overlaps geom "shin" by 0.1 m in the reference pose',
        "actuator: there is none: an agent has nothing to do",
    ]
    assert 'reset: [(joint: "knee", position: Constant(0.17453292519943295))]' in convert(path)


WELDED = """
    <option {fluid}/>
    <worldbody>
      <body name="arm"><joint name="turn" axis="0 0 1"/><inertial pos="0.5 0 0" mass="2" diaginertia="1 1 1"/>
        <body name="hand" pos="1 0 0"><inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.1"/>
          <body name="pin" pos="0.1 0 0"><inertial pos="0 0 0" mass="0.0005" diaginertia="1e-9 1e-9 1e-9"/></body>
        </body>
      </body>
    </worldbody>"""


def test_bodies_without_joints_are_parts_of_those_that_they_hang_on(model: Write) -> None:
    text = convert(model(WELDED.format(fluid="")))
    assert "Weld" not in text and 'name: "hand"' not in text
    assert "mass: 3.0005," in text
    assert 'without joints, and a part of it: body "hand", body "pin"' in text


def test_in_a_fluid_only_light_bodies_are_parts_of_others(model: Write) -> None:
    """The fluid resists each body: one that is a thousand times lighter than the body that it hangs on is left out."""
    text = convert(model(WELDED.format(fluid='density="1000"')))
    assert 'name: "hand_weld", parent: "arm", child: "hand", type: Weld' in text
    assert 'name: "pin"' not in text
    assert "mass: 1.0005," in text
    assert 'without joints, and a part of it: body "pin"' in text


def test_welded_bodies_move_as_in_mujoco(model: Write) -> None:
    """A thousand times heavier bodies on light ones, nested, with turned frames, geoms, a rope's site and a hinge on them:
    mass, center of mass and inertia are those of MuJoCo's composite body, and so is the motion."""
    path = model("""
        <option timestep="0.002"/>
        <default><geom contype="0" conaffinity="0"/></default>
        <worldbody>
          <body name="rod">
            <joint name="first" axis="0 1 0" damping="0.1"/>
            <geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.02" mass="0.01"/>
            <body name="frame" pos="0.3 0 0.1" euler="0 40 0">
              <geom type="box" pos="0.1 0 0.05" size="0.1 0.1 0.05" mass="10"/>
              <body name="weight" pos="0.1 0 0.2" euler="0 -70 0">
                <inertial pos="0.03 0 0.1" mass="3" diaginertia="0.1 0.2 0.15"/>
                <body name="end" pos="0 0 -0.2">
                  <joint name="second" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.05" mass="4"/>
                </body>
              </body>
            </body>
          </body>
        </worldbody>
        <actuator><motor joint="first" gear="5" ctrlrange="-1 1" ctrllimited="true"/></actuator>""")
    conversion = convert_model(path, Options())
    [rod, end] = conversion.bodies.bodies.values()
    assert rod.mass == pytest.approx(13.01, rel=1e-12)
    # MuJoCo's composite inertia of the whole tree is about the tree's center of mass: Steiner's theorem for both parts.
    center = np.array(conversion.source.data.subtree_com[rod.index])[[0, 2]]
    own = [body.inertia + body.mass * np.sum((world_point(body) - center) ** 2) for body in (rod, end)]
    mujoco.mj_crb(conversion.source.model, conversion.source.data)
    assert sum(own) == pytest.approx(float(conversion.source.data.crb[rod.index][1]), rel=1e-9)
    ours, theirs = free_motions(path, 5, 40, Start({"first": 0.3}, {"first": 1.0, "second": -2.0}))
    errors = [one.differences(theirs, 40)[0] for one in ours]
    # What remains is MuJoCo's own error, of its time step.
    assert errors[2] < 0.001
    assert errors[2] < 0.8 * errors[1] < 0.64 * errors[0]


def world_point(body: Body) -> Array:
    """Center of mass of a body in the plane at the reference pose."""
    cosine, sine = np.cos(body.frame.angle), np.sin(body.frame.angle)
    x, y = body.com
    return body.frame.origin + np.array([cosine * x - sine * y, sine * x + cosine * y])


@pytest.mark.parametrize(
    ("actuator", "expected"),
    [
        ('<motor joint="turn" gear="3" ctrlrange="-1 1"/>', 'JointForce("turn"), gear: 3.0'),
        ('<general joint="turn" gainprm="2" gear="3" ctrlrange="-1 1"/>', 'JointForce("turn"), gear: 6.0'),
        ('<velocity joint="turn" kv="2" ctrlrange="-1 1"/>', 'VelocityServo(joint: "turn", kv: 2.0)'),
        (
            '<position joint="turn" kp="5" kv="0.5" gear="2" ctrlrange="-1 1" forcerange="-3 3"/>',
            'PositionServo(joint: "turn", kp: 20.0, kv: 2.0, force_limit: 6.0), gear: 0.5',
        ),
    ],
)
def test_actuators(actuator: str, expected: str, model: Write) -> None:
    text = convert(
        model(f"""
        <worldbody><body name="arm"><joint name="turn" axis="0 0 1"/><geom size="0.1" pos="0.5 0 0"/></body></worldbody>
        <actuator>{actuator}</actuator>""")
    )
    [line] = re.findall(r"actuators: \[.*?\n    sensors", text, re.DOTALL)
    assert f"type: {expected}, control: Continuous(-1.0, 1.0)" in " ".join(line.split())
