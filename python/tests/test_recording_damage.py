"""Recording onto damaged files, by two recorders at once, with a full disk, and after a process was killed."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import warnings
import zlib
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from test_recording_writer import Counter, episodes_of, frames, play, run_script, state_file

import seedbed
from seedbed.recording import RecordingError, RecordVisitation, RecordVisitationVector
from seedbed.state_files import scan


def record(folder: Path, episodes: int, agent: int = 0, **options) -> None:
    with RecordVisitation(Counter(), folder, agent, **options) as environment:
        play(environment, episodes)


def inspected(folder: Path) -> dict:
    """What the program reads in the folder: it verifies all checksums, too."""
    command = [seedbed.command(), "inspect", str(folder), "--json"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return json.loads(result.stdout)


def starts(path: Path) -> list[int]:
    """Offsets of the frames, and the end of the file."""
    offsets = [16]
    for _, payload in frames(path):
        offsets.append(offsets[-1] + 16 + len(payload))
    return offsets


def zero(path: Path, offset: int, count: int) -> None:
    content = bytearray(path.read_bytes())
    content[offset : offset + count] = bytes(count)
    path.write_bytes(content)


def flip(path: Path, offset: int) -> None:
    content = bytearray(path.read_bytes())
    content[offset] ^= 255
    path.write_bytes(content)


def test_zeros_within_an_episode_are_cut_off_and_kept(tmp_path: Path):
    """56 zeros in the third of five episodes; then 1,000 more."""
    record(tmp_path, 5)
    path = state_file(tmp_path)
    whole = path.read_bytes()
    # The first frame is the header.
    offset = starts(path)[3]
    zero(path, offset + 20, 56)
    environment = RecordVisitation(Counter(), tmp_path, resume=True)
    with pytest.warns(RuntimeWarning, match="episodes from number 2 on .*2 episodes are left.*agent_0.states.cut_1") as warned:
        environment.reset()
    assert f"is damaged at offset {offset} (wrong checksum)" in str(warned[0].message)
    play(environment, 1000)
    environment.close()
    assert [episode["episode"] for episode in episodes_of(path, 2, 1)] == list(range(1002))
    assert len(inspected(tmp_path)["agents"]) == 1
    kept = path.with_name("agent_0.states.cut_1").read_bytes()
    header = starts(path)[1]
    assert kept[:header] == whole[:header]
    assert len(kept) == header + len(whole) - offset


def test_any_changed_byte_is_noticed(tmp_path: Path):
    """Whatever byte changes, either all episodes before it are continued, or nothing is."""
    record(tmp_path, 3)
    path = state_file(tmp_path)
    content, offsets = path.read_bytes(), starts(path)
    for offset in range(len(content)):
        damaged = bytearray(content)
        damaged[offset] ^= 1 << (offset % 8)
        path.write_bytes(damaged)
        environment = RecordVisitation(Counter(), tmp_path, resume=True, keep_unfinished=False)
        if offset < offsets[1]:
            with pytest.raises((RecordingError, ValueError)):
                environment.reset()
            assert path.read_bytes() == damaged
            environment.close()
            continue
        with pytest.warns(RuntimeWarning):
            environment.reset()
        environment.close()
        whole = sum(end <= offset for end in offsets[2:5])
        assert len(scan(path).episodes) == whole and scan(path).damage is None, offset
    for copy in path.parent.glob("*.cut_*"):
        copy.unlink()


def test_a_damaged_length_is_no_unfinished_episode(tmp_path: Path):
    record(tmp_path, 3)
    path = state_file(tmp_path)
    offset = starts(path)[2]
    content = bytearray(path.read_bytes())
    content[offset + 4 : offset + 8] = (1 << 30).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.warns(RuntimeWarning, match=f"damaged at offset {offset}"):
        record(tmp_path, 1, resume=True)
    assert len(episodes_of(path, 2, 1)) == 2


@pytest.mark.parametrize("frame", ["episode 0 again", "end with another number", "second header", "unknown kind", "outcome 3"])
def test_valid_frames_that_do_not_belong_there(tmp_path: Path, frame: str):
    """Frames with right checksums, which the program refuses."""
    record(tmp_path, 2)
    path = state_file(tmp_path)
    content, offsets = path.read_bytes(), starts(path)
    first = content[offsets[1] : offsets[2]]
    payload = {
        "episode 0 again": first[16:],
        "end with another number": (7).to_bytes(4, "little"),
        "second header": content[offsets[0] + 16 : offsets[1]],
        "unknown kind": b"",
        "outcome 3": (2).to_bytes(4, "little") + first[20:28] + (3).to_bytes(4, "little") + first[32:],
    }[frame]
    kind = {"end with another number": b"DONE", "second header": b"HEAD", "unknown kind": b"MORE"}.get(frame, b"EPIS")
    start = kind + len(payload).to_bytes(4, "little") + zlib.crc32(payload).to_bytes(4, "little")
    path.write_bytes(content + start + zlib.crc32(start).to_bytes(4, "little") + payload)
    with pytest.warns(RuntimeWarning, match=f"damaged at offset {len(content)}"):
        record(tmp_path, 1, resume=True)
    assert [episode["episode"] for episode in episodes_of(path, 2, 1)] == [0, 1, 2]
    assert inspected(tmp_path)


def test_zeros_at_the_end_are_an_unfinished_episode(tmp_path: Path):
    """As after a failure of the machine."""
    record(tmp_path, 2)
    path = state_file(tmp_path)
    path.write_bytes(path.read_bytes() + bytes(5000))
    with pytest.warns(RuntimeWarning, match=r"removed the unfinished last episode \(5000 bytes\)"):
        record(tmp_path, 1, resume=True)
    assert len(episodes_of(path, 2, 1)) == 3
    assert not list(path.parent.glob("*.cut_*"))


@pytest.mark.parametrize("size", [0, 7, 16, 20, 40])
def test_a_cut_header_cannot_be_resumed(tmp_path: Path, size: int):
    record(tmp_path, 2)
    path = state_file(tmp_path)
    path.write_bytes(path.read_bytes()[:size])
    environment = RecordVisitation(Counter(), tmp_path, resume=True)
    with pytest.raises(RecordingError, match="cannot be resumed; replace it with overwrite=True"):
        environment.reset()
    assert path.stat().st_size == size
    record(tmp_path, 1, overwrite=True)
    assert len(episodes_of(path, 2, 1)) == 1


def test_another_version_cannot_be_resumed(tmp_path: Path):
    record(tmp_path, 1)
    path = state_file(tmp_path)
    start = b"SBSTATES" + (2).to_bytes(4, "little")
    changed = start + zlib.crc32(start).to_bytes(4, "little") + path.read_bytes()[16:]
    path.write_bytes(changed)
    environment = RecordVisitation(Counter(), tmp_path, resume=True)
    with pytest.raises(RecordingError, match="format version 2, expected 1"):
        environment.reset()
    assert path.read_bytes() == changed


def test_unknown_fields_of_headers_are_ignored(tmp_path: Path):
    """As the format says, so that a later version can add some."""
    record(tmp_path, 1)
    path = state_file(tmp_path)
    content, (first, second, *_) = path.read_bytes(), starts(path)
    payload = content[first + 16 : second].replace(b'{"agent"', b'{"new":{"a":1},"agent"')
    start = b"HEAD" + len(payload).to_bytes(4, "little") + zlib.crc32(payload).to_bytes(4, "little")
    path.write_bytes(content[:first] + start + zlib.crc32(start).to_bytes(4, "little") + payload + content[second:])
    record(tmp_path, 1, resume=True)
    assert len(episodes_of(path, 2, 1)) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"names": ["a", "b"]}, "observations is a .* but in the file observation_0"),
        ({"units": {"observation_0": "m"}}, "observations is"),
        ({"ranges": {"observation_0": (0, 1)}}, "observations is"),
        ({"action_names": ["push"]}, "actions is push"),
        ({"environment": "Other"}, "environment is 'Other', but in the file 'Counter'"),
    ],
)
def test_other_headers_are_not_resumed(tmp_path: Path, options: dict, words: str):
    record(tmp_path, 1)
    before = state_file(tmp_path).read_bytes()
    environment = RecordVisitation(Counter(), tmp_path, resume=True, **options)
    with pytest.raises(ValueError, match=words):
        environment.reset()
    environment.close()
    assert state_file(tmp_path).read_bytes() == before


def test_the_file_of_another_agent_is_not_resumed(tmp_path: Path):
    record(tmp_path, 1)
    shutil.copy(state_file(tmp_path), state_file(tmp_path, 1))
    with pytest.raises(ValueError, match="agent is 1, but in the file 0"):
        RecordVisitation(Counter(), tmp_path, 1, resume=True).reset()


def vector(folder: Path, copies: int = 3, **options) -> RecordVisitationVector:
    environments = SyncVectorEnv([partial(Counter, 3)] * copies, autoreset_mode="SameStep")
    return RecordVisitationVector(environments, folder, keep_unfinished=False, **options)


def step(environments: RecordVisitationVector, steps: int) -> None:
    environments.reset()
    for _ in range(steps):
        environments.step(np.zeros(environments.num_envs, np.int64))


def test_each_file_of_a_folder_is_cut_where_it_is_damaged(tmp_path: Path):
    environments = vector(tmp_path)
    step(environments, 12)
    environments.close()
    for agent, frame in ((0, 4), (2, 2)):
        flip(state_file(tmp_path, agent), starts(state_file(tmp_path, agent))[frame] + 30)
    environments = vector(tmp_path, resume=True)
    with pytest.warns(RuntimeWarning) as warned:
        step(environments, 6)
    environments.close()
    assert ["agent_0" in str(warned[0].message), "agent_2" in str(warned[1].message)] == [True, True]
    assert [len(episodes_of(state_file(tmp_path, agent), 2, 1)) for agent in range(3)] == [3 + 2, 4 + 2, 1 + 2]
    assert inspected(tmp_path)


def test_if_one_file_cannot_be_resumed_none_is_changed(tmp_path: Path):
    environments = vector(tmp_path)
    step(environments, 6)
    environments.close()
    flip(state_file(tmp_path, 0), starts(state_file(tmp_path, 0))[2] + 30)
    flip(state_file(tmp_path, 2), 20)
    files = sorted(path for path in tmp_path.rglob("*") if path.is_file())
    before = [path.read_bytes() for path in files]
    for _ in range(2):
        # Twice: agents are not locked after the first failure.
        with pytest.raises(RecordingError, match="agent_2.states is damaged"):
            vector(tmp_path, resume=True).reset()
    assert sorted(path for path in tmp_path.rglob("*") if path.is_file()) == files
    assert [path.read_bytes() for path in files] == before


def test_a_damaged_file_yields_no_tables(tmp_path: Path):
    record(tmp_path, 2)
    flip(state_file(tmp_path), starts(state_file(tmp_path))[1] + 30)
    with pytest.warns(RuntimeWarning, match=r"agent_0.states is damaged at offset .*summary.json are not written"):
        record(tmp_path, 1, agent=1)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["states"]
    with pytest.warns(RuntimeWarning, match="0 episodes are left"):
        record(tmp_path, 1, resume=True)
    assert json.loads((tmp_path / "summary.json").read_text())["env_steps"] == 6


@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"[", b"{}"])
def test_a_damaged_summary_is_written_again(tmp_path: Path, content: bytes):
    record(tmp_path, 1)
    for name in ("summary.json", "episodes.csv"):
        (tmp_path / name).write_bytes(content)
    record(tmp_path, 1, resume=True)
    assert json.loads((tmp_path / "summary.json").read_text())["episodes_per_agent"] == 2


@pytest.mark.parametrize("how", ["resume", "overwrite"])
def test_two_recorders_of_one_agent_at_once(tmp_path: Path, how: str):
    first = RecordVisitation(Counter(), tmp_path)
    play(first, 1)
    second = RecordVisitation(Counter(), tmp_path, **{how: True})
    with pytest.raises(RecordingError, match="another recorder writes to it, in this process or another one"):
        second.reset()
    second.close()
    # Other agents, other folders.
    record(tmp_path, 1, agent=1)
    record(tmp_path / "other", 1)
    play(first, 1)
    first.close()
    assert len(episodes_of(state_file(tmp_path), 2, 1)) == 2
    record(tmp_path, 1, **{how: True})
    assert len(episodes_of(state_file(tmp_path), 2, 1)) == (3 if how == "resume" else 1)


def test_two_processes_with_one_agent(tmp_path: Path):
    """The lock goes with the process, even if it is killed."""
    end = "print('ready', flush=True); sys.stdin.read(); environment.close()"
    script = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    script += "from test_recording_writer import Counter, play\nfrom seedbed.recording import RecordVisitation\n"
    script += f"environment = RecordVisitation(Counter(3), {str(tmp_path)!r})\nplay(environment, 2)\n{end}"
    command = [sys.executable, "-c", script]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=tmp_path.parent)
    assert process.stdout is not None and process.stdout.readline() == b"ready\n"
    # Locks of a process are lost if it closes another file with them: a second agent opens and closes one.
    record(tmp_path, 1, agent=1)
    with pytest.raises(RecordingError, match="another recorder writes to it"):
        record(tmp_path, 1, resume=True)
    process.kill()
    process.wait()
    process.stdin.close(), process.stdout.close()
    record(tmp_path, 1, resume=True)
    assert len(episodes_of(state_file(tmp_path), 2, 1)) == 3


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere locks belong to the process, which loses them")
def test_a_copy_of_the_folder_does_not_unlock_the_agents(tmp_path: Path):
    environment = RecordVisitation(Counter(), tmp_path / "run")
    play(environment, 1)
    shutil.copytree(tmp_path / "run", tmp_path / "copy")
    script = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
    script += "from test_recording_damage import record; from pathlib import Path\n"
    script += f"record(Path({str(tmp_path / 'run')!r}), 1, overwrite=True)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert "RecordingError" in done.stderr and "another recorder writes to it" in done.stderr
    play(environment, 1)
    environment.close()
    assert len(scan(state_file(tmp_path / "run")).episodes) == 2


def test_a_deleted_folder_is_recorded_again(tmp_path: Path):
    """Also while a recorder of the deleted files still exists, as in notebooks."""
    first = RecordVisitation(Counter(), tmp_path / "run")
    play(first, 1)
    shutil.rmtree(tmp_path / "run")
    record(tmp_path / "run", 2)
    with pytest.raises(RecordingError):
        first.close()
    assert len(episodes_of(state_file(tmp_path / "run"), 2, 1)) == 2


def test_parts_of_killed_processes_are_removed(tmp_path: Path):
    record(tmp_path, 1)
    parts = [tmp_path / "states/.agent_0.states.12345.part", tmp_path / ".summary.json.12345.part", tmp_path / ".episodes.csv.7.part"]
    for part in parts:
        part.write_bytes(b"half")
    record(tmp_path, 1, resume=True)
    assert not any(part.exists() for part in parts)


def calls_until_killed(folder: Path, call: int) -> str:
    """A script that resumes a damaged file, and is killed at a call that changes files."""
    return f"""
import os, signal, sys, warnings
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_recording_writer import Counter, play
from seedbed.recording import RecordVisitation
warnings.simplefilter("ignore")
left = {call}
def count(event, arguments):
    global left
    changes = event in ("os.remove", "os.rename", "os.truncate", "os.mkdir") or (event == "open" and arguments[2] & os.O_ACCMODE)
    if changes and {str(folder)!r} in str(arguments[0]):
        left -= 1
        if left < 0:
            os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(count)
with RecordVisitation(Counter(3), {str(folder)!r}, resume=True) as environment:
    play(environment, 1)
"""


def test_killed_at_each_change_of_a_file(tmp_path: Path):
    """Episodes before the damage are never lost, and the next process continues."""
    template = tmp_path / "template"
    record(template, 4)
    flip(state_file(template), starts(state_file(template))[3] + 30)
    for call in range(40):
        folder = tmp_path / str(call)
        shutil.copytree(template, folder)
        killed = subprocess.run([sys.executable, "-c", calls_until_killed(folder, call)], cwd=tmp_path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            record(folder, 1, resume=True)
        assert [episode["episode"] for episode in episodes_of(state_file(folder), 2, 1)][:3] == [0, 1, 2]
        assert not list(folder.rglob("*.part")), call
        assert len(list(folder.rglob("*.cut_*"))) in (1, 2)
        if killed.returncode == 0:
            break
        assert killed.returncode == -signal.SIGKILL
    else:
        pytest.fail("the script never ended")
    assert call > 8


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no limit of the size of files")
def test_a_full_disk_costs_the_episode_that_does_not_fit(tmp_path: Path):
    """Other episodes, and other copies, are recorded right."""
    resource = pytest.importorskip("resource")
    environments = vector(tmp_path, 2)
    step(environments, 6)
    sizes = [state_file(tmp_path, agent).stat().st_size for agent in range(2)]
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (sizes[0] + 10, limits[1]))
    try:
        for _ in range(2):
            environments.step(np.zeros(2, np.int64))
        with pytest.raises(RecordingError, match="cannot append to .*agent_0.states.*File too large"):
            environments.step(np.zeros(2, np.int64))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [state_file(tmp_path, agent).stat().st_size for agent in range(2)] == sizes
    for _ in range(6):
        environments.step(np.zeros(2, np.int64))
    environments.close()
    for agent in range(2):
        found = episodes_of(state_file(tmp_path, agent), 2, 1)
        assert [episode["episode"] for episode in found] == [0, 1, 2, 3]
        assert all(np.array_equal(episode["states"][:, 0], [0, 1, 2, 3]) for episode in found)
    assert inspected(tmp_path)


def test_a_full_disk_in_a_single_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Steps of an episode whose earlier part was lost are not recorded, also if the environment resets itself."""
    environment = RecordVisitation(Counter(3), tmp_path, keep_unfinished=True)
    play(environment, 1)
    with monkeypatch.context() as patch:
        patch.setattr("os.write", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left on device")))
        with pytest.raises(RecordingError, match="No space left"):
            play(environment, 1)
    play(environment, 1)
    environment.close()
    assert [episode["states"][:, 0].tolist() for episode in episodes_of(state_file(tmp_path), 2, 1)] == [[0, 1, 2, 3]] * 2


def test_an_interrupt_while_a_file_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Ctrl-C right after the bytes were written: the episode is lost, and the file is whole."""
    environment = RecordVisitation(Counter(3), tmp_path)
    play(environment, 1)

    def interrupted(descriptor: int, content: bytes, write=os.write) -> int:
        write(descriptor, content)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("os.write", interrupted)
        with pytest.raises(KeyboardInterrupt):
            play(environment, 1)
    play(environment, 1)
    environment.close()
    assert [episode["episode"] for episode in episodes_of(state_file(tmp_path), 2, 1)] == [0, 1]


def test_folders_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot record in .*file/run"):
        RecordVisitation(Counter(), tmp_path / "file" / "run").reset()

    def refuse(path: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)
    environment = RecordVisitation(Counter(), tmp_path / "run")
    with pytest.raises(RecordingError, match="cannot record in .*run: .*Permission denied"):
        environment.reset()
    environment.close()


def test_a_changed_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "other").mkdir()
    monkeypatch.chdir(tmp_path)
    environment = RecordVisitation(Counter(), "run")
    monkeypatch.chdir(tmp_path / "other")
    play(environment, 1)
    environment.close()
    assert (tmp_path / "run/summary.json").exists()


def test_a_file_that_was_read_is_what_was_killed(tmp_path: Path):
    """A process that is killed while it appends: all bytes of its last episode but some."""
    assert run_script(tmp_path, "os.kill(os.getpid(), signal.SIGKILL)").wait() == -signal.SIGKILL
    path = state_file(tmp_path)
    content, offsets = path.read_bytes(), starts(path)
    for end in range(offsets[3] + 1, offsets[4], 7):
        path.write_bytes(content[:end])
        with pytest.warns(RuntimeWarning, match="removed the unfinished last episode"):
            record(tmp_path, 1, resume=True)
        assert len(episodes_of(path, 2, 1)) == 3
