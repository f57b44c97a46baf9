//! Fuzzing: whatever a file or an argument contains, reading it ends with a value or an error, soon
//! and in little memory.
//!
//! Each test here changes valid inputs at random ([`mutate`]) and reads them ([`texts`], [`stored`],
//! [`external`]). [`driver`] runs a fixed number of inputs in a process of its own, which notices
//! panics, aborts, hangs and allocations that are too large. For hours, by hand:
//!
//! ```text
//! SEEDBED_FUZZ_SEED=7 SEEDBED_FUZZ_SECONDS=3600 cargo test --test it fuzz::scenarios
//! ```
//!
//! A failure prints the file with the input. To read only this input again:
//!
//! ```text
//! SEEDBED_FUZZ_INPUT=FILE cargo test --test it fuzz::scenarios
//! ```

mod driver;
mod external;
mod mutate;
mod stored;
mod texts;

use self::driver::Fuzzing;

#[test]
fn tasks() {
    Fuzzing {
        name: "tasks",
        inputs: 3000,
        set_up: texts::set_up,
        open: texts::tasks,
    }
    .run();
}

#[test]
fn scenarios() {
    Fuzzing {
        name: "scenarios",
        inputs: 1500,
        set_up: texts::set_up,
        open: texts::scenarios,
    }
    .run();
}

#[test]
fn studies() {
    Fuzzing {
        name: "studies",
        inputs: 500,
        set_up: texts::set_up,
        open: texts::studies,
    }
    .run();
}

#[test]
fn tunings() {
    Fuzzing {
        name: "tunings",
        inputs: 500,
        set_up: texts::set_up,
        open: texts::tunings,
    }
    .run();
}

#[test]
fn formulas() {
    Fuzzing {
        name: "formulas",
        inputs: 20_000,
        set_up: driver::nothing,
        open: texts::formulas,
    }
    .run();
}

#[test]
fn overrides() {
    Fuzzing {
        name: "overrides",
        inputs: 3000,
        set_up: driver::nothing,
        open: texts::overrides,
    }
    .run();
}

#[test]
fn checkpoints() {
    Fuzzing {
        name: "checkpoints",
        inputs: 1000,
        set_up: stored::set_up_checkpoints,
        open: stored::checkpoints,
    }
    .run();
}

#[test]
fn study_results() {
    Fuzzing {
        name: "study_results",
        inputs: 1000,
        set_up: stored::set_up_study_results,
        open: stored::study_results,
    }
    .run();
}

#[test]
fn state_files() {
    Fuzzing {
        name: "state_files",
        inputs: 5000,
        set_up: driver::nothing,
        open: stored::state_files,
    }
    .run();
}

#[cfg(feature = "rerun")]
#[test]
fn recordings() {
    Fuzzing {
        name: "recordings",
        inputs: 500,
        set_up: stored::set_up_recordings,
        open: stored::recordings,
    }
    .run();
}

#[test]
fn tables_of_others() {
    Fuzzing {
        name: "tables_of_others",
        inputs: 3000,
        set_up: external::set_up,
        open: external::tables,
    }
    .run();
}

#[test]
fn event_files_of_others() {
    Fuzzing {
        name: "event_files_of_others",
        inputs: 3000,
        set_up: external::set_up,
        open: external::event_files,
    }
    .run();
}
