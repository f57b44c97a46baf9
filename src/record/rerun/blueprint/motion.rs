//! The blueprint of a recording of motion: large scenes, played in real time.

use rerun::blueprint::components::{LoopMode, PlayState};
use rerun::blueprint::{Blueprint, ContainerLike, Grid, Tabs, TimePanel, TimeSeriesView, Vertical};

use super::{BlueprintConfig, ViewBuilder, blueprint_of_columns, text_views};
use crate::record::rerun::rows::ENV_STEP;

impl ViewBuilder {
    /// Scenes on the left; visited states, returns and the scenario on the right.
    pub(super) fn motion_blueprint(&mut self, config: &BlueprintConfig) -> Blueprint {
        let side_column =
            Vertical::new([self.visited_states(config), self.returns_and_texts(config)]);
        let columns: Vec<ContainerLike> = self
            .scenes(config)
            .into_iter()
            .chain([side_column.into()])
            .collect();
        let time_panel = TimePanel::new()
            .with_timeline(ENV_STEP)
            .with_fps(1.0 / config.control_step)
            .with_loop_mode(LoopMode::All)
            .with_play_state(PlayState::Playing);
        blueprint_of_columns(columns, [2.0, 1.0], time_panel)
    }

    /// The scenes of all agents with a recorded scene.
    pub(super) fn scenes(&mut self, config: &BlueprintConfig) -> Option<ContainerLike> {
        let mut scenes: Vec<ContainerLike> = config
            .scenes
            .iter()
            .map(|scene| self.scene(scene))
            .collect();
        match scenes.len() {
            0 | 1 => scenes.pop(),
            count => {
                let columns = (count as f64).sqrt().ceil() as u32;
                Some(
                    Grid::new(scenes)
                        .with_grid_columns(columns)
                        .with_name("Motion")
                        .into(),
                )
            }
        }
    }

    /// Densities of all visited states so far, of the team and of each agent.
    fn visited_states(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let agents = self.density_view(config, false, "density");
        if config.agents == 1 {
            return agents;
        }
        Tabs::new([self.density_view(config, true, "density"), agents]).into()
    }

    fn returns_and_texts(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let returns: ContainerLike = TimeSeriesView::new("Return of each episode")
            .with_origin("/curves/return")
            .into();
        self.set_legend(&returns, config);
        self.show_all_times(&returns);
        let [how_to_read, scenario] = text_views();
        Tabs::new([returns, how_to_read, scenario]).into()
    }
}
