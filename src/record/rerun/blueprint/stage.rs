//! How the viewer opens a recording that is about motion: scenes large, played at their own speed.

use rerun::blueprint::components::{LoopMode, PlayState};
use rerun::blueprint::{
    Blueprint, ContainerLike, Grid, Tabs, TextDocumentView, TimePanel, TimeSeriesView, Vertical,
};

use super::{Layout, Sheet, page};
use crate::record::rerun::rows::ENV_STEP;

impl Sheet {
    /// Scenes at the left, and what they add up to at the right.
    pub(super) fn stage(&mut self, layout: &Layout) -> Blueprint {
        let beside = Vertical::new([self.went(layout), self.outcome()]);
        let columns: Vec<ContainerLike> = self
            .scenes(layout)
            .into_iter()
            .chain([beside.into()])
            .collect();
        let time = TimePanel::new()
            .with_timeline(ENV_STEP)
            .with_fps(1.0 / layout.control_step)
            .with_loop_mode(LoopMode::All)
            .with_play_state(PlayState::Playing);
        page(columns, [2.0, 1.0], time)
    }

    /// The scene of each filmed agent.
    pub(super) fn scenes(&mut self, layout: &Layout) -> Option<ContainerLike> {
        let mut scenes: Vec<ContainerLike> = layout
            .filmed
            .iter()
            .map(|filmed| self.scene(filmed))
            .collect();
        match scenes.len() {
            0 | 1 => scenes.pop(),
            count => {
                let columns = (count as f64).sqrt().ceil() as u32;
                Some(
                    Grid::new(scenes)
                        .with_grid_columns(columns)
                        .with_name("Agents in motion")
                        .into(),
                )
            }
        }
    }

    /// All states so far in one picture, and each agent's in others.
    fn went(&mut self, layout: &Layout) -> ContainerLike {
        let agents = self.density(layout, false, "density");
        if layout.agents == 1 {
            return agents;
        }
        Tabs::new([self.density(layout, true, "density"), agents]).into()
    }

    fn outcome(&mut self) -> ContainerLike {
        let returns: ContainerLike = TimeSeriesView::new("Return of each episode")
            .with_origin("/curves/return")
            .into();
        self.all_times(&returns);
        let about = TextDocumentView::new("About")
            .with_origin("/scenario")
            .into();
        Tabs::new([returns, about]).into()
    }
}
