//! A team that is divided over ranks.

use crate::run::ranks::Ranks;
use seedbed_learn::agent::ActScratch;
use seedbed_learn::experience::Episode;
use seedbed_learn::experience::EpisodeInfo;
use seedbed_learn::experience::replay::Replay;
use seedbed_learn::nn::Tensor;
use seedbed_learn::team::{ActionRequest, AgentUpdate, LearningRequest, SavedTeam, Team, Workers};

/// The local agents of a team, which give rank 0 what they learned, and share the model that one of them
/// trains for all. All ranks must call the same functions in the same order.
struct TeamOnRanks {
    local: Box<dyn Team>,
    ranks: Ranks,
}

/// The team whose local agents are `local`.
pub(super) fn team_on_ranks(local: Box<dyn Team>, ranks: Ranks) -> Box<dyn Team> {
    if ranks.is_single() {
        return local;
    }
    Box::new(TeamOnRanks { local, ranks })
}

impl TeamOnRanks {
    /// Copies the model that one agent has trained for the team to all ranks. Returns whether there is one.
    fn pass_on_model(&mut self, workers: Workers<'_>) -> bool {
        let model = self.ranks.broadcast(self.local.shared_model());
        if let (Some(model), false) = (&model, self.ranks.is_first()) {
            let set = self.local.set_shared_model(model, workers);
            set.expect("all ranks have the same model");
        }
        model.is_some()
    }

    fn gather<'a>(&self, tensors: Vec<Tensor<'a>>) -> Vec<Tensor<'a>> {
        let owned: Vec<Tensor<'static>> = tensors.into_iter().map(Tensor::into_owned).collect();
        self.ranks.gather_lists(owned)
    }
}

impl Team for TeamOnRanks {
    fn agent_count(&self) -> usize {
        self.local.agent_count()
    }

    fn begin_round(&mut self, round: u32) {
        self.local.begin_round(round);
    }

    fn act(&self, request: &mut ActionRequest<'_>, scratch: &mut ActScratch) {
        self.local.act(request, scratch);
    }

    fn transition_interval(&self) -> Option<u32> {
        self.local.transition_interval()
    }

    fn add_transition(&mut self, episode: &Episode, step: usize) {
        self.local.add_transition(episode, step);
    }

    fn end_step(&mut self, workers: Workers<'_>) {
        self.local.end_step(workers);
    }

    /// The updates of the local agents.
    fn learn(&mut self, request: &LearningRequest<'_>, workers: Workers<'_>) -> Vec<AgentUpdate> {
        let mut updates = self.local.learn(request, workers);
        if self.pass_on_model(workers) {
            let first = updates.first();
            let error = first.and_then(|first| first.update.report.prediction_error);
            let error = self.ranks.broadcast(error);
            for update in &mut updates {
                update.update.report.prediction_error = error;
            }
        }
        updates
    }

    fn choose_episodes(
        &self,
        new_episodes: &[EpisodeInfo],
        earlier_updates: u32,
    ) -> Option<Vec<usize>> {
        self.local.choose_episodes(new_episodes, earlier_updates)
    }

    fn shared_model(&self) -> Option<Vec<u8>> {
        self.local.shared_model()
    }

    fn set_shared_model(&mut self, bytes: &[u8], workers: Workers<'_>) -> Result<(), String> {
        self.local.set_shared_model(bytes, workers)
    }

    fn probe_bonuses(&mut self, episode: &Episode, round: u32) -> Vec<Vec<f32>> {
        self.ranks
            .gather_lists(self.local.probe_bonuses(episode, round))
    }

    fn tensors(&self) -> Vec<Tensor<'_>> {
        self.gather(self.local.tensors())
    }

    fn initial_tensors(&self) -> Vec<Tensor<'_>> {
        self.gather(self.local.initial_tensors())
    }

    fn replay(&self) -> Option<&Replay> {
        self.local.replay()
    }

    fn replay_mut(&mut self) -> Option<&mut Replay> {
        self.local.replay_mut()
    }

    fn save(&self) -> SavedTeam {
        let saved = self.local.save();
        SavedTeam {
            parts: self.ranks.gather_lists(saved.parts),
            ..saved
        }
    }

    fn restore(&mut self, saved: &SavedTeam) -> Result<(), String> {
        self.local.restore(saved)
    }
}
