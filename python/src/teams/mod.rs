//! Teams of agents that learn in training loops of Python.

mod arrays;
mod rounds;
mod settings;
mod team;

pub(crate) use team::Team;
