//! How the episodes of all agents reach every agent: the only communication that training needs.

use crate::experience::Episode;

/// Makes the team's episodes of a round out of those that were played here.
pub trait Exchange: Send {
    /// All episodes of the round in (agent, episode) order.
    fn gather(&mut self, played_here: Vec<Episode>) -> Vec<Episode>;
}

/// The whole team plays in this process: nothing has to move.
#[derive(Debug, Default)]
pub struct OneProcess;

impl Exchange for OneProcess {
    fn gather(&mut self, played_here: Vec<Episode>) -> Vec<Episode> {
        played_here
    }
}
