//! Pictures of visited states, as tabs: the latest episodes, all so far, pairs of observations, and where bonuses come from.

use rerun::blueprint::{ContainerLike, Horizontal, Spatial2DView, Tabs, Vertical};
use rerun::datatypes::{Range2D, TimeInt, TimeRange, TimeRangeBoundary, VisibleTimeRange};
use rerun::external::re_sdk_types::blueprint::archetypes::{VisibleTimeRanges, VisualBounds2D};

use super::super::furniture::Wall;
use super::super::rows::{ENV_STEP, EPISODE, ROUND};
use super::super::walls::{Arrangement, TEAM_SHARE};
use super::{Layout, Sheet};

/// What hangs on a wall.
struct Hung<'a> {
    wall: Wall,
    /// The view's title.
    title: String,
    /// `/visitation` or `/pairs`.
    root: &'a str,
    /// Of the whole team, instead of each agent.
    of_team: bool,
    /// The entity below each agent.
    name: &'a str,
    /// The scale beside it, if there is one.
    scale: &'a str,
    /// Whether the latest episodes are shown on top of each other.
    adds_up: bool,
}

impl Sheet {
    pub(super) fn visited(&mut self, layout: &Layout) -> ContainerLike {
        let mut tabs = vec![self.latest(layout), self.so_far(layout)];
        if Arrangement::of(layout.agents) == Arrangement::Many {
            tabs.push(
                Vertical::new([self.lines(layout, false)])
                    .with_name("Lines")
                    .into(),
            );
        }
        tabs.push(self.pairs(layout));
        if layout.curious {
            tabs.push(self.bonuses(layout));
        }
        Tabs::new(tabs).into()
    }

    fn latest(&mut self, layout: &Layout) -> ContainerLike {
        let densities = self.density(layout, false, "latest");
        let tab = format!("Latest {} episodes", layout.quota.window);
        match Arrangement::of(layout.agents) {
            Arrangement::Alone => Vertical::new([self.lines(layout, false), densities])
                .with_name(tab)
                .into(),
            Arrangement::Few => Horizontal::new([self.lines(layout, false), densities])
                .with_name(tab)
                .into(),
            Arrangement::Many => {
                let team = [
                    self.density(layout, true, "latest"),
                    self.lines(layout, true),
                ];
                above(Horizontal::new(team).into(), densities, tab)
            }
        }
    }

    fn so_far(&mut self, layout: &Layout) -> ContainerLike {
        let (densities, tab) = (
            self.density(layout, false, "density"),
            "All states so far".to_owned(),
        );
        let arrangement = Arrangement::of(layout.agents);
        if arrangement == Arrangement::Alone {
            return Vertical::new([densities]).with_name(tab).into();
        }
        let mut team = vec![self.density(layout, true, "density")];
        if layout.compared {
            team.push(self.difference(layout));
        }
        match arrangement {
            Arrangement::Many => above(Horizontal::new(team).into(), densities, tab),
            _ => Horizontal::new([densities, Vertical::new(team).into()])
                .with_name(tab)
                .into(),
        }
    }

    fn pairs(&mut self, layout: &Layout) -> ContainerLike {
        let states = self.plots(layout, false);
        self.with_team(layout, "Pairs of observations", states, |sheet| {
            sheet.plots(layout, true)
        })
    }

    fn bonuses(&mut self, layout: &Layout) -> ContainerLike {
        let bonuses = self.bonus(layout, false);
        self.with_team(layout, "Where bonuses come from", bonuses, |sheet| {
            sheet.bonus(layout, true)
        })
    }

    fn with_team(
        &mut self,
        layout: &Layout,
        tab: &str,
        agents: ContainerLike,
        team: impl FnOnce(&mut Self) -> ContainerLike,
    ) -> ContainerLike {
        match Arrangement::of(layout.agents) {
            Arrangement::Alone => Vertical::new([agents]).with_name(tab.to_owned()).into(),
            Arrangement::Few => Horizontal::new([agents, team(self)])
                .with_name(tab.to_owned())
                .into(),
            Arrangement::Many => above(team(self), agents, tab.to_owned()),
        }
    }

    fn lines(&mut self, layout: &Layout, of_team: bool) -> ContainerLike {
        let wall = if of_team {
            layout.walls.team_axes
        } else {
            layout.walls.axes
        };
        let title = sampled(layout, of_team);
        self.hang(
            layout,
            &Hung {
                wall,
                title,
                root: "visitation",
                of_team,
                name: "lines",
                scale: "lines",
                adds_up: true,
            },
        )
    }

    pub(super) fn density(&mut self, layout: &Layout, of_team: bool, name: &str) -> ContainerLike {
        let wall = if of_team {
            layout.walls.team_axes
        } else {
            layout.walls.axes
        };
        let span = if name == "latest" {
            format!("of the latest {}", rounds(layout))
        } else {
            "so far".to_owned()
        };
        let title = format!("{}: all states {span}", whose(layout, of_team));
        self.hang(
            layout,
            &Hung {
                wall,
                title,
                root: "visitation",
                of_team,
                name,
                scale: "density",
                adds_up: false,
            },
        )
    }

    fn plots(&mut self, layout: &Layout, of_team: bool) -> ContainerLike {
        let wall = if of_team {
            layout.walls.team_pairs
        } else {
            layout.walls.pairs
        };
        let title = sampled(layout, of_team);
        self.hang(
            layout,
            &Hung {
                wall,
                title,
                root: "pairs",
                of_team,
                name: "states",
                scale: "states",
                adds_up: true,
            },
        )
    }

    fn bonus(&mut self, layout: &Layout, of_team: bool) -> ContainerLike {
        let wall = if of_team {
            layout.walls.team_pairs
        } else {
            layout.walls.pairs
        };
        let title = format!(
            "{}: mean intrinsic reward of the latest {}",
            whose(layout, of_team),
            rounds(layout)
        );
        self.hang(
            layout,
            &Hung {
                wall,
                title,
                root: "pairs",
                of_team,
                name: "bonus",
                scale: "bonus",
                adds_up: false,
            },
        )
    }

    fn difference(&mut self, layout: &Layout) -> ContainerLike {
        let title = "Two agents: where which has the larger share of states";
        let contents = [
            "/visitation/difference/**".to_owned(),
            "/visitation/team/axes/**".to_owned(),
        ];
        self.view(
            layout.walls.team_axes,
            title,
            "visitation",
            contents.to_vec(),
        )
    }

    fn hang(&mut self, layout: &Layout, hung: &Hung<'_>) -> ContainerLike {
        let Hung {
            wall,
            title,
            root,
            of_team,
            name,
            scale,
            adds_up,
        } = hung;
        let furniture = if *root == "pairs" { "frames" } else { "axes" };
        let place = if *of_team {
            format!("/{root}/team")
        } else {
            format!("/{root}")
        };
        let mut contents: Vec<String> = vec![
            format!("{place}/{furniture}/**"),
            format!("{place}/scale/{scale}"),
            format!("{place}/scale/{scale}/labels"),
            format!("{place}/scale/{name}/ends"),
        ];
        let agents = (0..layout.agents).map(|agent| format!("/{root}/agent_{agent}/{name}"));
        contents.extend(agents.filter(|_| !of_team));
        contents.extend(of_team.then(|| format!("/{root}/team/{name}")));
        let view = self.view(*wall, title, root, contents);
        if *adds_up {
            self.property(
                &view,
                "VisibleTimeRanges",
                VisibleTimeRanges::new(windows(layout)),
            );
        }
        view
    }

    fn view(
        &mut self,
        wall: Wall,
        title: &str,
        root: &str,
        contents: Vec<String>,
    ) -> ContainerLike {
        let view = Spatial2DView::new(title.to_owned()).with_origin(format!("/{root}"));
        let view: ContainerLike = view.with_contents(contents).into();
        let [x_range, y_range] = wall.tiles.bounds().map(|ends| ends.map(f64::from));
        let bounds = Range2D {
            x_range: x_range.into(),
            y_range: y_range.into(),
        };
        self.property(&view, "VisualBounds2D", VisualBounds2D::new(bounds));
        self.background(&view);
        view
    }
}

fn above(team: ContainerLike, agents: ContainerLike, tab: String) -> ContainerLike {
    Vertical::new([team, agents])
        .with_row_shares([TEAM_SHARE, 1.0 - TEAM_SHARE])
        .with_name(tab)
        .into()
}

fn whose(layout: &Layout, of_team: bool) -> &'static str {
    match (of_team, layout.agents) {
        (true, _) => "Team",
        (false, 1) => "Agent 0",
        _ => "Each agent",
    }
}

fn rounds(layout: &Layout) -> String {
    if layout.window == 1 {
        "round".to_owned()
    } else {
        format!("{} rounds", layout.window)
    }
}

fn sampled(layout: &Layout, of_team: bool) -> String {
    let window = layout.quota.window;
    format!(
        "{}: some states of the latest {window} episodes, by {}",
        whose(layout, of_team),
        layout.coloured_by
    )
}

/// The latest episodes. An episode takes at least two steps, so that half as many steps hold no more.
fn windows(layout: &Layout) -> [VisibleTimeRange; 3] {
    let latest = |timeline: &str, length: u32| VisibleTimeRange {
        timeline: timeline.into(),
        range: TimeRange {
            start: TimeRangeBoundary::CursorRelative(TimeInt(1 - i64::from(length))),
            end: TimeRangeBoundary::CursorRelative(TimeInt(0)),
        },
    };
    let window = layout.quota.window;
    [
        latest(EPISODE, window),
        latest(ROUND, window),
        latest(ENV_STEP, (2 * window).max(layout.time_limit + 1)),
    ]
}
