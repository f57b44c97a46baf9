//! Trains the team of a scenario with the library, round by round.
//!
//! Run with `cargo run --release --example train`.

use std::error::Error;
use std::path::Path;

use seedbed::run::Plan;
use seedbed::run::training::Trainer;

fn main() -> Result<(), Box<dyn Error>> {
    let overrides = ["stop=Episodes(100)".to_owned()];
    let plan = Plan::load(Path::new("scenarios/cartpole.ron"), &overrides)?;
    let mut trainer = Trainer::from_scenario(&plan.scenario, &plan.description, 1)?;
    while !trainer.is_done() {
        trainer.advance()?;
        if trainer.rounds().is_multiple_of(20) {
            let recent = trainer.measures().final_return().unwrap_or_default();
            println!("round {:3}: mean return {recent:.1}", trainer.rounds());
        }
    }
    println!("solved: {}", trainer.is_solved());
    Ok(())
}
