//! `seedbed doctor`: what is installed beside the program, and how to get what is missing.

use std::process::{Command, Stdio};

use seedbed::provenance;
use seedbed_env::gymnasium::python;

/// What one line of the report says.
struct Finding {
    name: &'static str,
    found: Result<String, String>,
}

/// Prints what was found. What is missing is needed for some commands only, so that the exit status is 0.
pub(super) fn doctor() {
    let findings = [
        program(),
        python_interpreter(),
        python_package(
            "gymnasium",
            "environments of Gymnasium: pip install gymnasium",
        ),
        python_package(
            "seedbed",
            "Python: pip install ./python in the directory of the repository",
        ),
        tool(
            "rerun viewer",
            "rerun",
            "--version",
            "browsing recordings: pip install rerun-sdk==0.36.3",
        ),
        mpi(),
        tool(
            "Slurm",
            "sbatch",
            "--version",
            "studies on clusters with Slurm; without it, any number of processes can share one",
        ),
        tool(
            "TensorBoard",
            "tensorboard",
            "--version",
            "looking at --tensorboard DIR: pip install tensorboard",
        ),
    ];
    for Finding { name, found } in findings {
        match found {
            Ok(what) => say!("{name:<14} {what}"),
            Err(reason) => say!("{name:<14} not found; needed for {reason}"),
        }
    }
}

fn program() -> Finding {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let commit = provenance::commit().map_or(String::new(), |commit| format!(" ({commit})"));
    let found = format!(
        "{}{commit}, {threads} threads, {}",
        env!("CARGO_PKG_VERSION"),
        provenance::cpu_level()
    );
    Finding {
        name: "seedbed",
        found: Ok(found),
    }
}

fn python_interpreter() -> Finding {
    let path = python();
    let version = first_line(Command::new(&path).arg("--version"));
    Finding {
        name: "Python",
        found: version
            .map(|version| format!("{version} ({})", path.display()))
            .ok_or_else(|| {
                format!(
                    "environments of Gymnasium; `{}` does not run: name another by --python",
                    path.display()
                )
            }),
    }
}

/// A package of the interpreter that runs environments of Gymnasium.
fn python_package(name: &'static str, needed_for: &str) -> Finding {
    let code = format!("import importlib.metadata as m; print(m.version('{name}'))");
    let version = first_line(Command::new(python()).args(["-c", &code]));
    Finding {
        name,
        found: version.ok_or_else(|| needed_for.to_owned()),
    }
}

fn tool(name: &'static str, program: &str, argument: &str, needed_for: &str) -> Finding {
    let version = first_line(Command::new(program).arg(argument));
    let found = match version {
        Some(version) => Ok(version),
        None if is_installed(program) => Ok(format!("`{program} {argument}` fails")),
        None => Err(needed_for.to_owned()),
    };
    Finding { name, found }
}

/// Whether a folder of `PATH` has this program.
fn is_installed(program: &str) -> bool {
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(program).is_file())
}

fn mpi() -> Finding {
    let is_built_in = cfg!(feature = "mpi");
    let launcher = first_line(Command::new("mpirun").arg("--version"));
    Finding {
        name: "MPI",
        found: match (is_built_in, launcher) {
            (true, Some(launcher)) => Ok(format!("built in; {launcher}")),
            (true, None) => Err("one run over several computers: `mpirun` is missing".to_owned()),
            (false, _) => Err(
                "one run over several computers: build with `cargo build --release --features mpi`"
                    .to_owned(),
            ),
        },
    }
}

/// The first line that a command prints; `None` if it cannot be run, fails or prints nothing.
fn first_line(command: &mut Command) -> Option<String> {
    let output = command
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().next().filter(|line| !line.is_empty())?;
    output.status.success().then(|| line.to_owned())
}
