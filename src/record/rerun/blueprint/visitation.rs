//! The views of visited states, as tabs: the latest episodes, all states so far, pairs of
//! observations, and mean bonuses.

use rerun::blueprint::{ContainerLike, Horizontal, Spatial2DView, Tabs, Vertical};
use rerun::datatypes::{Range2D, TimeInt, TimeRange, TimeRangeBoundary, VisibleTimeRange};
use rerun::external::re_sdk_types::blueprint::archetypes::{VisibleTimeRanges, VisualBounds2D};

use super::super::annotations::PanelLayout;
use super::super::layouts::{Arrangement, SCALE_WIDTH, TEAM_SHARE};
use super::super::rows::{ENV_STEP, EPISODE, ROUND};
use super::{BlueprintConfig, ViewBuilder};
use crate::run::recorder::Focus;
use crate::scenario::recording::Difference;

/// A view of images with a common layout.
struct ImageViewSpec<'a> {
    layout: PanelLayout,
    /// The view's title.
    title: String,
    /// `/visitation` or `/pairs`.
    root: &'a str,
    /// Whether the view shows the whole team instead of each agent.
    of_team: bool,
    /// Name of the entity below the entity of each agent or of the team.
    name: &'a str,
    /// The color scale beside the images.
    scale: &'a str,
    /// Whether the view shows the rows of the latest episodes on top of each other.
    accumulates: bool,
}

impl ViewBuilder {
    pub(super) fn visitation_tabs(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let mut tabs = vec![self.latest_tab(config), self.so_far_tab(config)];
        if Arrangement::of(config.agents) == Arrangement::Many {
            let [team, agents] = [true, false].map(|of_team| self.lines_view(config, of_team));
            tabs.push(team_above_agents(team, agents, "Lines".to_owned()));
        }
        tabs.push(self.pairs_tab(config));
        if config.has_bonus {
            tabs.push(self.bonus_tab(config));
        }
        Tabs::new(tabs).into()
    }

    /// Below the team: densities and, of a few agents, lines.
    fn latest_tab(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let densities = self.density_view(config, false, "latest");
        let tab = format!("Latest {} episodes", config.line_quota.window);
        let arrangement = Arrangement::of(config.agents);
        if arrangement == Arrangement::Many {
            return team_above_agents(self.team_row(config, "latest"), densities, tab);
        }
        let lines = self.lines_view(config, false);
        if arrangement == Arrangement::Alone {
            return Vertical::new([lines, densities]).with_name(tab).into();
        }
        let share = config.layouts.lines_share();
        let agents = Horizontal::new([lines, densities]).with_column_shares([share, 1.0 - share]);
        team_above_agents(self.team_row(config, "latest"), agents.into(), tab)
    }

    fn so_far_tab(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let densities = self.density_view(config, false, "density");
        let tab = "All states so far".to_owned();
        if Arrangement::of(config.agents) == Arrangement::Alone {
            return Vertical::new([densities]).with_name(tab).into();
        }
        team_above_agents(self.team_row(config, "density"), densities, tab)
    }

    /// The team's density beside the difference between two agents or, without one, the team's lines.
    fn team_row(&mut self, config: &BlueprintConfig, name: &str) -> ContainerLike {
        let density = self.density_view(config, true, name);
        let second = match difference_title(&config.difference) {
            Some(title) => self.difference_view(config, &title),
            None => self.lines_view(config, true),
        };
        Horizontal::new([density, second]).into()
    }

    fn pairs_tab(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let states = self.pairs_view(config, false);
        self.tab_with_team(config, "Pairs of observations", states, |builder| {
            builder.pairs_view(config, true)
        })
    }

    fn bonus_tab(&mut self, config: &BlueprintConfig) -> ContainerLike {
        let bonuses = self.bonus_view(config, false);
        self.tab_with_team(config, "Mean bonus", bonuses, |builder| {
            builder.bonus_view(config, true)
        })
    }

    fn tab_with_team(
        &mut self,
        config: &BlueprintConfig,
        tab: &str,
        agents: ContainerLike,
        team: impl FnOnce(&mut Self) -> ContainerLike,
    ) -> ContainerLike {
        match Arrangement::of(config.agents) {
            Arrangement::Alone => Vertical::new([agents]).with_name(tab.to_owned()).into(),
            Arrangement::Few => Horizontal::new([agents, team(self)])
                .with_name(tab.to_owned())
                .into(),
            Arrangement::Many => team_above_agents(team(self), agents, tab.to_owned()),
        }
    }

    fn lines_view(&mut self, config: &BlueprintConfig, of_team: bool) -> ContainerLike {
        let layout = if of_team {
            config.layouts.team_axes
        } else {
            config.layouts.axes
        };
        let title = sample_title(config, of_team);
        self.image_view(
            config,
            &ImageViewSpec {
                layout,
                title,
                root: "visitation",
                of_team,
                name: "lines",
                scale: "lines",
                accumulates: true,
            },
        )
    }

    pub(super) fn density_view(
        &mut self,
        config: &BlueprintConfig,
        of_team: bool,
        name: &str,
    ) -> ContainerLike {
        let layout = if of_team {
            config.layouts.team_axes
        } else {
            config.layouts.axes
        };
        let span = match (name, config.focus) {
            ("latest", _) => format!(" in the latest {}", window_text(config)),
            (_, Focus::Motion) => String::new(),
            (_, Focus::Learning) => " so far".to_owned(),
        };
        let title = format!("{}: all states{span}", subject(config, of_team));
        self.image_view(
            config,
            &ImageViewSpec {
                layout,
                title,
                root: "visitation",
                of_team,
                name,
                scale: "density",
                accumulates: false,
            },
        )
    }

    fn pairs_view(&mut self, config: &BlueprintConfig, of_team: bool) -> ContainerLike {
        let layout = if of_team {
            config.layouts.team_pairs
        } else {
            config.layouts.pairs
        };
        let title = sample_title(config, of_team);
        self.image_view(
            config,
            &ImageViewSpec {
                layout,
                title,
                root: "pairs",
                of_team,
                name: "states",
                scale: "states",
                accumulates: true,
            },
        )
    }

    fn bonus_view(&mut self, config: &BlueprintConfig, of_team: bool) -> ContainerLike {
        let layout = if of_team {
            config.layouts.team_pairs
        } else {
            config.layouts.pairs
        };
        let title = format!(
            "{}: mean bonus in the latest {}",
            subject(config, of_team),
            window_text(config)
        );
        self.image_view(
            config,
            &ImageViewSpec {
                layout,
                title,
                root: "pairs",
                of_team,
                name: "bonus",
                scale: "bonus",
                accumulates: false,
            },
        )
    }

    fn difference_view(&mut self, config: &BlueprintConfig, title: &str) -> ContainerLike {
        let contents = [
            "/visitation/difference".to_owned(),
            "/visitation/team/scale/difference/**".to_owned(),
            "/visitation/team/axes/**".to_owned(),
        ];
        let layout = config.layouts.team_axes;
        self.visitation_view(layout, true, title, "visitation", contents.to_vec())
    }

    fn image_view(&mut self, config: &BlueprintConfig, spec: &ImageViewSpec<'_>) -> ContainerLike {
        let ImageViewSpec {
            layout,
            title,
            root,
            of_team,
            name,
            scale,
            accumulates,
        } = spec;
        let annotations = if *root == "pairs" { "frames" } else { "axes" };
        let parent_entity = if *of_team {
            format!("/{root}/team")
        } else {
            format!("/{root}")
        };
        let mut contents: Vec<String> = vec![
            format!("{parent_entity}/{annotations}/**"),
            format!("{parent_entity}/scale/{scale}"),
            format!("{parent_entity}/scale/{scale}/labels"),
            format!("{parent_entity}/scale/{name}/ends"),
        ];
        let agents = (0..config.agents).map(|agent| format!("/{root}/agent_{agent}/{name}"));
        contents.extend(agents.filter(|_| !of_team));
        contents.extend(of_team.then(|| format!("/{root}/team/{name}")));
        let has_scale = *name != "lines" || config.layouts.lines_have_scale || config.agents == 1;
        let view = self.visitation_view(*layout, has_scale, title, root, contents);
        if *accumulates {
            self.set_property(
                &view,
                "VisibleTimeRanges",
                VisibleTimeRanges::new(visible_ranges(config)),
            );
        }
        view
    }

    fn visitation_view(
        &mut self,
        layout: PanelLayout,
        has_scale: bool,
        title: &str,
        root: &str,
        contents: Vec<String>,
    ) -> ContainerLike {
        let view = Spatial2DView::new(title.to_owned()).with_origin(format!("/{root}"));
        let view: ContainerLike = view.with_contents(contents).into();
        let [[left, right], y_range] = layout.tiles.bounds().map(|ends| ends.map(f64::from));
        let scale_width = if has_scale {
            0.0
        } else {
            f64::from(SCALE_WIDTH)
        };
        let x_range = [left, right - scale_width];
        let bounds = Range2D {
            x_range: x_range.into(),
            y_range: y_range.into(),
        };
        self.set_property(&view, "VisualBounds2D", VisualBounds2D::new(bounds));
        self.set_background(&view);
        view
    }
}

fn team_above_agents(team: ContainerLike, agents: ContainerLike, tab: String) -> ContainerLike {
    Vertical::new([team, agents])
        .with_row_shares([TEAM_SHARE, 1.0 - TEAM_SHARE])
        .with_name(tab)
        .into()
}

/// The title of the view of differences; `None` if no agents are compared.
fn difference_title(difference: &Difference) -> Option<String> {
    match difference {
        Difference::Off => None,
        Difference::MostDifferent => {
            Some("Difference: the two most different agents (all states so far)".to_owned())
        }
        Difference::Between(one, other) => Some(format!(
            "Difference: agent {} − agent {} (all states so far)",
            **one, **other
        )),
    }
}

fn subject(config: &BlueprintConfig, of_team: bool) -> &'static str {
    match (of_team, config.agents) {
        (true, _) => "Team",
        (false, 1) => "Agent 0",
        _ => "Each agent",
    }
}

fn window_text(config: &BlueprintConfig) -> String {
    if config.window == 1 {
        "round".to_owned()
    } else {
        format!("{} rounds", config.window)
    }
}

fn sample_title(config: &BlueprintConfig, of_team: bool) -> String {
    let window = config.line_quota.window;
    let subject = subject(config, of_team);
    let colors = if config.layouts.lines_have_scale {
        format!(", colored by {}", config.colored_by)
    } else {
        String::new()
    };
    format!("{subject}: sample of the latest {window} episodes{colors}")
}

/// The latest episodes on each timeline. On the timeline of steps, the range has the length of one
/// episode of maximum length, or of 2 steps per episode if that is longer: an episode has at least
/// two rows, so that at most the given number of episodes is visible.
fn visible_ranges(config: &BlueprintConfig) -> [VisibleTimeRange; 3] {
    let latest = |timeline: &str, length: u32| VisibleTimeRange {
        timeline: timeline.into(),
        range: TimeRange {
            start: TimeRangeBoundary::CursorRelative(TimeInt(1 - i64::from(length))),
            end: TimeRangeBoundary::CursorRelative(TimeInt(0)),
        },
    };
    let window = config.line_quota.window;
    [
        latest(EPISODE, window),
        latest(ROUND, window),
        latest(ENV_STEP, (2 * window).max(config.time_limit + 1)),
    ]
}
