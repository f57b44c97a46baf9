//! `seedbed doctor`.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::Command;

#[test]
fn what_is_missing_is_named_with_what_it_is_for() {
    let folder = tempfile::tempdir().unwrap();
    let sbatch = folder.path().join("sbatch");
    fs::write(&sbatch, "#!/bin/sh\necho slurm 23.02.1\n").unwrap();
    fs::set_permissions(&sbatch, fs::Permissions::from_mode(0o755)).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_seedbed"))
        .arg("doctor")
        .env("PATH", folder.path())
        .env("SEEDBED_PYTHON", "/nowhere/python")
        .output()
        .unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("seedbed        0.1.0"), "{text}");
    assert_eq!(
        lines[1],
        "Python         not found; needed for environments of Gymnasium; `/nowhere/python` does not run: name another by --python"
    );
    assert_eq!(
        lines[2],
        "gymnasium      not found; needed for environments of Gymnasium: pip install gymnasium"
    );
    assert!(
        lines[5].starts_with("MPI            not found; needed for one run over several computers")
    );
    assert_eq!(lines[6], "Slurm          slurm 23.02.1");
    assert_eq!(
        lines[7],
        "TensorBoard    not found; needed for looking at --tensorboard DIR: pip install tensorboard"
    );
    assert_eq!(lines.len(), 8, "{text}");
}
