//! Films of trained policies: episodes without learning.

use super::bodies::Bodies;
use super::pictures;
use super::timeline::ShownEpisode;
use super::{Film, FilmError, FilmSettings, Motion, SeedsOfEpisodes};
use crate::record::{RecordedEpisode, RecordedScene};
use crate::run::Plan;
use crate::run::evaluate::{EvaluationSettings, load_to_play, play_episode};
use crate::run::facts::EpisodeDetails;
use crate::run::folder::RunFolder;
use crate::run::training::Trainer;
use crate::scenario::recording::SceneSettings;
use seedbed_env::TaskDescription;
use seedbed_input::numbers::ranged_count;
use seedbed_learn::experience::Episode;

/// Number that the first round of an evaluation has in random streams; the next one has one less.
const FIRST_ROUND: u32 = u32::MAX;

impl Film {
    /// The film of the trained policy of `settings.agent`, which plays `evaluation.episodes` episodes without learning.
    ///
    /// # Errors
    /// The folder has no checkpoint, the team has no such agent, or an environment cannot go on.
    pub fn of_policy(
        folder: &RunFolder,
        settings: FilmSettings,
        evaluation: &EvaluationSettings<'_>,
    ) -> Result<Self, FilmError> {
        let (plan, mut trainer) = load_to_play(folder, evaluation)?;
        let agent_count = trainer.agent_count();
        if settings.agent as usize >= agent_count {
            return Err(FilmError::NoAgent {
                run: folder.path().to_owned(),
                agent: settings.agent,
                agent_count,
            });
        }
        let (mut episodes, mut scenes) = (Vec::new(), Vec::new());
        for number in 0..evaluation.episodes {
            let (episode, details) = play(&mut trainer, settings.agent, evaluation, number)?;
            scenes.extend(details.map(scene_of));
            episodes.push(episode);
        }
        let settings = settings.long_enough(&episodes, trainer.spec().control_step);
        Ok(Self {
            title: title(&plan, evaluation),
            motion: motion(&plan, &trainer, (&episodes, scenes), settings, evaluation),
            settings,
            training: None,
        })
    }
}

fn title(plan: &Plan, evaluation: &EvaluationSettings<'_>) -> String {
    let elsewhere = evaluation
        .environment
        .map(|_| format!(" in {}", plan.description.spec().name));
    format!(
        "{}, trained policy{}",
        plan.name,
        elsewhere.unwrap_or_default()
    )
}

/// Maximum duration of a film of whole episodes, s.
const MAX_SECONDS: f64 = 60.0;

impl FilmSettings {
    /// Unless a duration is chosen, that of whole episodes, of which each is shown for the time of the longest.
    fn long_enough(self, episodes: &[Episode], control_step: f64) -> Self {
        let longest = episodes.iter().map(Episode::length).max().unwrap_or(0);
        let longest = self.seconds_of_episode(longest as f64 * control_step);
        let whole = longest * episodes.len() as f64;
        Self {
            seconds: Some(self.seconds.unwrap_or(whole.clamp(1.0, MAX_SECONDS))),
            ..self
        }
    }
}

/// Plays one episode of the team. Returns that of the filmed agent, and its bodies.
fn play(
    trainer: &mut Trainer,
    agent: u32,
    evaluation: &EvaluationSettings<'_>,
    number: u32,
) -> Result<(Episode, Option<EpisodeDetails>), FilmError> {
    let scene = SceneSettings {
        agents: vec![agent.into()].into(),
        every: ranged_count(1),
    };
    let played = play_episode(trainer, evaluation, number, Some(&scene))?;
    let mut episodes = played.episodes.into_iter();
    let episode = episodes.find(|episode| episode.agent == agent);
    let mut details = played.details.into_iter();
    let details = details.find(|details| details.agent == agent && !details.poses.is_empty());
    Ok((episode.expect("all agents play"), details))
}

fn scene_of(details: EpisodeDetails) -> RecordedScene {
    RecordedScene {
        episode: details.episode,
        poses: details.poses,
        terrain: details.terrain,
    }
}

fn motion(
    plan: &Plan,
    trainer: &Trainer,
    (episodes, scenes): (&[Episode], Vec<RecordedScene>),
    settings: FilmSettings,
    evaluation: &EvaluationSettings<'_>,
) -> Motion {
    if let TaskDescription::Gymnasium(environment) = &plan.description {
        let seeds = SeedsOfEpisodes {
            run_seed: evaluation.seed,
            episodes_per_round: 1,
        };
        let episodes: Vec<RecordedEpisode> = episodes.iter().map(as_recorded).collect();
        return match pictures::of_episodes(&episodes, environment, seeds, settings) {
            Ok((timeline, pictures)) => Motion::Pictures(timeline, pictures),
            Err(reason) => Motion::None(Some(reason)),
        };
    }
    let shown = episodes
        .iter()
        .map(|episode| ShownEpisode::with_rewards(episode.episode, &episode.rewards));
    let timeline = settings.timeline(shown.collect(), trainer.spec());
    let bodies = trainer.scene().and_then(|scene| Bodies::new(scene, scenes));
    match bodies {
        Some(bodies) => Motion::Bodies(timeline, bodies),
        None => Motion::None(Some("the task has no bodies to film".to_owned())),
    }
}

/// An episode as recordings of environments of Gymnasium have it, which begins from its round's random stream.
fn as_recorded(episode: &Episode) -> RecordedEpisode {
    RecordedEpisode {
        agent: episode.agent,
        episode: episode.episode,
        round: FIRST_ROUND - episode.round,
        observations: episode.observations.clone(),
        actions: episode.actions.clone(),
        info: Vec::new(),
        rewards: episode.rewards.clone(),
        intrinsic_rewards: Vec::new(),
        advantages: Vec::new(),
        outcome: episode.outcome,
    }
}
