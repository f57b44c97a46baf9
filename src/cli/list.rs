//! `seedbed list`.

use std::path::{Path, PathBuf};

use super::Listed;
use super::check::actions;
use crate::agent::Algorithm;
use crate::env;
use crate::run::Plan;

pub(super) fn list(what: Option<Listed>) {
    let wanted = |kind| what.is_none() || what == Some(kind);
    if wanted(Listed::Environments) {
        environments();
    }
    if wanted(Listed::Scenarios) {
        scenarios();
    }
    if wanted(Listed::Algorithms) {
        algorithms();
    }
}

fn environments() {
    say!("Environments (envs/)");
    for path in ron_files(Path::new("envs")) {
        match env::load(&path) {
            Ok(description) => print_environment(&description.spec),
            Err(error) => say!("  {}\n      cannot be used: {error}", path.display()),
        }
    }
    say!("");
}

fn print_environment(spec: &env::Spec) {
    say!("  {}\n      {}", spec.name, spec.description);
    for quantity in &spec.observations {
        let [low, high] = quantity.range;
        say!("      observes  {:<12} {low} to {high} {}", quantity.name, quantity.unit);
    }
    say!("      acts      {}", actions(spec));
    say!("      {} steps of {} s at most", spec.time_limit, spec.control_step);
}

fn scenarios() {
    say!("Scenarios (scenarios/)");
    for path in ron_files(Path::new("scenarios")) {
        match Plan::load(&path, &[]) {
            Ok(plan) => {
                let (agents, task) = (plan.scenario.agents.count.get(), &plan.description.spec.name);
                say!(
                    "  {:<32} {agents} agents in {task}, {} episodes each at most",
                    path.display(),
                    plan.scenario.most_episodes()
                );
            }
            Err(error) => say!("  {}\n      cannot be used: {error}", path.display()),
        }
    }
    say!("");
}

fn algorithms() {
    say!("Algorithms (`algorithm:` in a scenario)");
    for catalogued in Algorithm::catalogue() {
        say!("  {}\n      {}", catalogued.name, catalogued.purpose);
        for parameter in &catalogued.parameters {
            say!("      {:<18} {}", parameter.name, parameter.meaning);
            say!("      {:<18}   default {}", "", parameter.default);
        }
    }
}

/// All `.ron` files below a folder, sorted.
fn ron_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = entries
        .flat_map(|path| if path.is_dir() { ron_files(&path) } else { vec![path] })
        .filter(|path| path.extension().is_some_and(|extension| extension == "ron"))
        .collect();
    files.sort();
    files
}
