//! Native part of the Python package `seedbed`. It is imported as `seedbed._native` by the modules in
//! `python/seedbed/`, which give it the interfaces of Gymnasium and PettingZoo.

mod sealed;
mod tasks;
mod teams;
mod texts;

/// The module `seedbed._native`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use crate::tasks::{Action, Batch, Quantity, Task, TaskError, builtin_tasks};
    #[pymodule_export]
    use crate::teams::Team;

    #[pymodule_export]
    #[expect(
        non_upper_case_globals,
        reason = "Python's name of the version of a package"
    )]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
