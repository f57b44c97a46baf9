//! Which state each frame of a film shows.

/// The episodes of one agent whose motion is shown, all for the same time. Motion is in real time; of longer
/// episodes, the last seconds are shown, which tell how they end.
#[derive(Debug)]
pub(super) struct Timeline {
    /// Number of each episode, and of its states: `[shown episodes]`, at least one.
    pub(super) episodes: Vec<(u32, usize)>,
    /// Number of environment steps per frame.
    pub(super) steps_per_frame: f64,
    /// Number of frames.
    pub(super) frames: usize,
}

/// What a frame shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Shown {
    /// Index of the episode among those that are shown.
    pub(super) index: usize,
    /// Number of the episode.
    pub(super) episode: u32,
    /// State of the episode, from 0.
    pub(super) state: usize,
}

impl Timeline {
    pub(super) fn shown_at(&self, frame: usize) -> Shown {
        let index = self.index_at(frame);
        let (episode, states) = self.episodes[index];
        let first_frame = |index: usize| (index * self.frames).div_ceil(self.episodes.len());
        let steps = |frames: usize| (frames as f64 * self.steps_per_frame) as usize;
        let last = states - 1;
        let start = last.saturating_sub(steps(first_frame(index + 1) - first_frame(index)));
        Shown {
            index,
            episode,
            state: (start + steps(frame - first_frame(index))).min(last),
        }
    }

    /// The newest episode of which a frame shows states: it grows evenly between those whose motion is shown.
    /// `last`: the last episode of the run
    pub(super) fn episode_at(&self, frame: usize, last: u32) -> u32 {
        let index = self.index_at(frame);
        let position = (frame + 1) as f64 / self.frames.max(1) as f64;
        let start = self.episodes[index].0;
        let end = self.episodes.get(index + 1).map_or(last, |next| next.0);
        let within = position * self.episodes.len() as f64 - index as f64;
        start + (within.clamp(0.0, 1.0) * f64::from(end.saturating_sub(start))) as u32
    }

    fn index_at(&self, frame: usize) -> usize {
        (frame * self.episodes.len() / self.frames.max(1)).min(self.episodes.len() - 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two episodes of 3 and 11 states in eight frames, with two steps per frame: the second is longer than its four
    /// frames, so that its last eight steps are shown.
    #[test]
    fn long_episodes_are_shown_at_their_end() {
        let timeline = Timeline {
            episodes: vec![(0, 3), (9, 11)],
            steps_per_frame: 2.0,
            frames: 8,
        };
        let states: Vec<_> = (0..8).map(|frame| timeline.shown_at(frame)).collect();
        let shown = |shown: &Shown| (shown.episode, shown.state);
        let expected = [
            (0, 0),
            (0, 2),
            (0, 2),
            (0, 2),
            (9, 2),
            (9, 4),
            (9, 6),
            (9, 8),
        ];
        assert_eq!(states.iter().map(shown).collect::<Vec<_>>(), expected);
        // Halfway between the episodes 0 and 9 after two of four frames.
        assert_eq!(
            [1, 3, 7].map(|frame| timeline.episode_at(frame, 20)),
            [4, 9, 20]
        );
    }
}
