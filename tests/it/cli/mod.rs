//! The command line: messages, exit statuses, and the files that commands write. One file per command.

mod arguments;
mod bench;
mod check;
mod completions;
#[cfg(unix)]
mod doctor;
mod evaluate;
mod explore;
mod export;
mod film;
mod floor;
mod list;
mod new;
mod preview;
mod run;
mod runs;
mod tabular_run;
