//! `seedbed preview`.

use crate::util::{seedbed, stderr, stdout};

#[test]
fn preview_records_a_task_without_training() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("new").join("look.rrd");
    let output = seedbed(&[
        "preview",
        "cartpole",
        "--episodes",
        "2",
        "--film",
        "--out",
        path.to_str().unwrap(),
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(
        stdout(&output)
            .lines()
            .filter(|line| line.starts_with("episode "))
            .count(),
        2
    );
    assert!(path.metadata().unwrap().len() > 10_000);
    let film = std::fs::read(path.with_extension("gif")).unwrap();
    assert!(film.starts_with(b"GIF89a"));

    let mistyped = seedbed(&["preview", "cartpol"]);
    assert_eq!(mistyped.status.code(), Some(2));
    assert!(
        stderr(&mistyped).ends_with("  = help: did you mean `cartpole`?\n"),
        "{}",
        stderr(&mistyped)
    );
}
