//! Which state each frame of a film shows.

/// The episodes of one agent whose motion is shown, all for the same time. Motion is in real time; of longer
/// episodes, the last seconds are shown, which tell how they end.
#[derive(Debug)]
pub(super) struct Timeline {
    /// The episodes, at least one.
    pub(super) episodes: Vec<ShownEpisode>,
    /// Number of environment steps per frame.
    pub(super) steps_per_frame: f64,
    /// Number of frames.
    pub(super) frames: usize,
    /// Time between two states, s.
    pub(super) control_step: f64,
    /// Number of frames for which the last state of an episode is shown, at most a third of the episode's.
    pub(super) frames_at_end: usize,
}

/// An episode whose motion is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ShownEpisode {
    /// Number of the episode.
    pub(super) number: u32,
    /// Number of its states.
    pub(super) states: usize,
    /// Sum of the rewards up to each state: `[states]`; empty if rewards are not known.
    pub(super) returns: Vec<f64>,
}

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shown {
    /// Index of the episode among those that are shown.
    pub(super) index: usize,
    /// State of the episode, from 0.
    pub(super) state: usize,
}

impl ShownEpisode {
    /// An episode with these rewards: `[states − 1]`
    pub(super) fn with_rewards(number: u32, rewards: &[f32]) -> Self {
        let mut returns = vec![0.0];
        let mut sum = 0.0;
        for reward in rewards {
            sum += f64::from(*reward);
            returns.push(sum);
        }
        Self {
            number,
            states: returns.len(),
            returns,
        }
    }
}

impl Timeline {
    pub(super) fn shown_at(&self, frame: usize) -> Shown {
        let index = self.index_at(frame);
        let first_frame = |index: usize| (index * self.frames).div_ceil(self.episodes.len());
        let steps = |frames: usize| (frames as f64 * self.steps_per_frame) as usize;
        let last = self.episodes[index].states - 1;
        let frames = first_frame(index + 1) - first_frame(index);
        let moving = frames.saturating_sub(1 + self.frames_at_end.min(frames / 3));
        let start = last.saturating_sub(steps(moving));
        let state = if frame - first_frame(index) >= moving {
            last
        } else {
            start + steps(frame - first_frame(index))
        };
        Shown {
            index,
            state: state.min(last),
        }
    }

    /// Number, clock and return of what a frame shows, such as `episode 30: 2.4 s, return 187`.
    pub(super) fn caption(&self, shown: Shown) -> String {
        let episode = &self.episodes[shown.index];
        let seconds = shown.state as f64 * self.control_step;
        let number = episode.number;
        match episode.returns.get(shown.state) {
            Some(sum) => format!("episode {number}: {seconds:.1} s, return {}", short(*sum)),
            None => format!("episode {number}: {seconds:.1} s"),
        }
    }

    /// The newest episode of which a frame shows states: it grows evenly between those whose motion is shown.
    /// `last`: the last episode of the run
    pub(super) fn episode_at(&self, frame: usize, last: u32) -> u32 {
        let index = self.index_at(frame);
        let position = (frame + 1) as f64 / self.frames.max(1) as f64;
        let start = self.episodes[index].number;
        let end = self
            .episodes
            .get(index + 1)
            .map_or(last, |next| next.number);
        let within = position * self.episodes.len() as f64 - index as f64;
        start + (within.clamp(0.0, 1.0) * f64::from(end.saturating_sub(start))) as u32
    }

    fn index_at(&self, frame: usize) -> usize {
        (frame * self.episodes.len() / self.frames.max(1)).min(self.episodes.len() - 1)
    }
}

/// A sum of rewards with as many decimals as can be read while it changes.
fn short(sum: f64) -> String {
    let decimals = usize::from(sum.abs() < 9.95);
    let text = format!("{sum:.decimals$}");
    match text.as_str() {
        "-0.0" => "0.0".to_owned(),
        _ => text.replace('-', "−"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn episode(number: u32, states: usize) -> ShownEpisode {
        ShownEpisode {
            number,
            states,
            returns: Vec::new(),
        }
    }

    /// Two episodes of 3 and 11 states in eight frames, with two steps per frame: the second is longer than its four
    /// frames, so that its last six steps are shown.
    #[test]
    fn long_episodes_are_shown_at_their_end() {
        let timeline = Timeline {
            episodes: vec![episode(0, 3), episode(9, 11)],
            steps_per_frame: 2.0,
            frames: 8,
            control_step: 0.1,
            frames_at_end: 0,
        };
        let shown = |frame| {
            let Shown { index, state } = timeline.shown_at(frame);
            (timeline.episodes[index].number, state)
        };
        let expected = [
            (0, 0),
            (0, 2),
            (0, 2),
            (0, 2),
            (9, 4),
            (9, 6),
            (9, 8),
            (9, 10),
        ];
        assert_eq!((0..8).map(shown).collect::<Vec<_>>(), expected);
        // Halfway between the episodes 0 and 9 after two of four frames.
        assert_eq!(
            [1, 3, 7].map(|frame| timeline.episode_at(frame, 20)),
            [4, 9, 20]
        );
    }

    /// Of ten steps in six frames, with three steps per frame, the last nine are shown, and the end in the last three frames: where
    /// it ends, and two more. If the number of steps is no multiple of those of a frame, the end is shown as well.
    #[test]
    fn the_end_of_an_episode_is_shown_for_some_time() {
        let states = |steps_per_frame, frames, frames_at_end| {
            let timeline = Timeline {
                episodes: vec![episode(0, 11)],
                steps_per_frame,
                frames,
                control_step: 0.1,
                frames_at_end,
            };
            let shown = (0..frames).map(|frame| timeline.shown_at(frame).state);
            shown.collect::<Vec<_>>()
        };
        assert_eq!(states(3.0, 6, 2), [1, 4, 7, 10, 10, 10]);
        assert_eq!(states(1.67, 7, 0), [0, 1, 3, 5, 6, 8, 10]);
        assert_eq!(states(1.0, 2, 9), [9, 10]);
    }

    /// After three steps of 0.2 s with the rewards 4, −6 and 12.
    #[test]
    fn captions_have_the_time_and_the_return_so_far() {
        let timeline = Timeline {
            episodes: vec![ShownEpisode::with_rewards(7, &[4.0, -6.0, 12.0])],
            steps_per_frame: 1.0,
            frames: 4,
            control_step: 0.2,
            frames_at_end: 0,
        };
        let caption = |state| timeline.caption(Shown { index: 0, state });
        assert_eq!(caption(0), "episode 7: 0.0 s, return 0.0");
        assert_eq!(caption(2), "episode 7: 0.4 s, return −2.0");
        assert_eq!(caption(3), "episode 7: 0.6 s, return 10");
    }
}
