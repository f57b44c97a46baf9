//! How the viewer opens a recording: pictures of visited states on the left, returns, updates and the scene on the right.

mod stage;

use rerun::blueprint::{
    Blueprint, BlueprintActivation, BlueprintPanel, ContainerLike, Grid, Horizontal, SelectionPanel, Spatial2DView, Tabs,
    TextDocumentView, TimePanel, TimeSeriesView, Vertical,
};
use rerun::components::Range1D;
use rerun::datatypes::{Range2D, TimeInt, TimeRange, TimeRangeBoundary, VisibleTimeRange};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    Background, PlotLegend, ScalarAxis, TimeAxis, VisibleTimeRanges, VisualBounds2D,
};
use rerun::external::re_sdk_types::blueprint::components::{BackgroundKind, Corner2D, PanelState, PlayState};
use rerun::log::LogMsg;
use rerun::{AsComponents, EntityPath, RecordingStreamBuilder, StoreKind, TimePoint, Timeline};

use super::Focus;
use super::axes::Lettering;
use super::curves::{TEAM_CURVES, UPDATE_CURVES};
use super::framing::Bounds;
use super::rows::{ENV_STEP, EPISODE, ROUND, rgb, single_row};
use super::sink::Fault;
use crate::record::visitation::{Axes, HEIGHT, LineQuota};

/// With more agents than this, lines and densities share their place.
const AGENTS_SIDE_BY_SIDE: u32 = 4;

/// With more agents than this, a legend would cover the curves.
const AGENTS_IN_LEGEND: u32 = 8;

/// As dark as what the density image shows where nothing was visited.
const BACKGROUND: [u8; 3] = [0, 0, 4];

/// Points of the screen to the left, for the pictures of visited states, on a screen of 1600 × 1000 points.
const ROOM: [f32; 2] = [960.0, 940.0];

/// Points that a view's title takes.
const TITLE: f32 = 28.0;

/// Room beside the outer axes for their names, in pixels of the density image.
const MARGIN: f32 = 28.0;

/// What the layout depends on.
#[derive(Clone)]
pub(super) struct Layout<'a> {
    pub(super) agents: u32,
    pub(super) axes: &'a Axes,
    pub(super) quota: LineQuota,
    pub(super) time_limit: u32,
    pub(super) filmed: Vec<Filmed>,
    pub(super) control_step: f64,
    pub(super) focus: Focus,
}

/// The scene that is shown.
#[derive(Clone)]
pub(super) struct Filmed {
    /// Whose bodies are drawn.
    pub(super) agent: u32,
    /// The entity from which they are seen.
    pub(super) origin: String,
    /// Where they were at first.
    pub(super) bounds: Option<Bounds>,
}

impl Layout<'_> {
    /// For the views of up to four agents, and for the team's.
    pub(super) fn wide_lettering(&self) -> Lettering {
        let agents = self.agents.min(AGENTS_SIDE_BY_SIDE);
        Lettering::new(self.axes, self.scale(places(agents), 4.0), true)
    }

    /// For the views of more agents.
    pub(super) fn narrow_lettering(&self) -> Lettering {
        Lettering::new(self.axes, self.scale(places(self.agents), 2.0), false)
    }

    fn lettering(&self) -> Lettering {
        if self.agents <= AGENTS_SIDE_BY_SIDE { self.wide_lettering() } else { self.narrow_lettering() }
    }

    /// Points of the screen that a pixel of the density image gets.
    fn scale(&self, [columns, rows]: [u32; 2], lines_of_words: f32) -> f32 {
        let across = ROOM[0] / columns as f32 / (self.axes.width() as f32 + 2.0 * MARGIN);
        let down = (ROOM[1] / rows as f32 - TITLE - lines_of_words * Lettering::LINE) / HEIGHT as f32;
        across.min(down).max(0.5)
    }
}

/// Columns and rows of pictures to the left. A picture is about twice as wide as high.
fn places(agents: u32) -> [u32; 2] {
    match agents {
        0 | 1 => [1, 2],
        2..=AGENTS_SIDE_BY_SIDE => [2, agents],
        agents => {
            let columns = (f64::from(agents) / 2.0).sqrt().ceil() as u32;
            [columns, agents.div_ceil(columns)]
        }
    }
}

/// The messages that make the viewer show `layout`.
pub(super) fn messages(application: &'static str, layout: &Layout<'_>) -> Result<Vec<LogMsg>, Fault> {
    let mut sheet = Sheet::default();
    let blueprint = sheet.blueprint(layout);
    let mut messages = encoded(application, &blueprint)?;
    let Some(store) = messages.first().map(|message| message.store_id().clone()) else { return Ok(messages) };
    let activation = messages.len() - 1;
    for (entity, property) in &sheet.properties {
        let start = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        let chunk = single_row(entity.clone(), start, property.as_ref())?;
        let message = chunk.to_arrow_msg().map_err(|error| error.to_string())?;
        messages.insert(activation, LogMsg::ArrowMsg(store.clone(), message));
    }
    Ok(messages)
}

/// The SDK hands out a blueprint's messages only through a stream.
fn encoded(application: &'static str, blueprint: &Blueprint) -> Result<Vec<LogMsg>, Fault> {
    let in_words = |error: rerun::RecordingStreamError| error.to_string();
    let (stream, storage) = RecordingStreamBuilder::new(application).enabled(true).memory().map_err(in_words)?;
    blueprint.send(&stream, BlueprintActivation::default()).map_err(in_words)?;
    stream.flush_blocking().map_err(|error| error.to_string())?;
    Ok(storage.take().into_iter().filter(|message| message.store_id().kind() == StoreKind::Blueprint).collect())
}

/// Collects the properties of views, which the SDK's own views cannot hold.
#[derive(Default)]
struct Sheet {
    properties: Vec<(EntityPath, Box<dyn AsComponents>)>,
}

impl Sheet {
    fn blueprint(&mut self, layout: &Layout<'_>) -> Blueprint {
        if layout.focus == Focus::Motion && !layout.filmed.is_empty() {
            return self.stage(layout);
        }
        let columns = [self.visited(layout), self.learned(layout)];
        let time =
            TimePanel::new().with_state(PanelState::Collapsed).with_timeline(EPISODE).with_play_state(PlayState::Following);
        Blueprint::new(Horizontal::new(columns).with_column_shares([3.0, 2.0]))
            .with_auto_views(false)
            .with_auto_layout(false)
            .with_blueprint_panel(BlueprintPanel::from_state(PanelState::Collapsed))
            .with_selection_panel(SelectionPanel::from_state(PanelState::Collapsed))
            .with_time_panel(time)
    }

    /// Lines beside the density of each agent, or both as tabs.
    fn visited(&mut self, layout: &Layout<'_>) -> ContainerLike {
        let (agents, [columns, _]) = (0..layout.agents, places(layout.agents));
        if layout.agents <= AGENTS_SIDE_BY_SIDE {
            let views: Vec<_> = agents.flat_map(|agent| [self.lines(layout, agent), self.density(layout, agent)]).collect();
            return Grid::new(views).with_grid_columns(columns).into();
        }
        let densities: Vec<_> = agents.clone().map(|agent| self.density(layout, agent)).collect();
        let lines: Vec<_> = agents.map(|agent| self.lines(layout, agent)).collect();
        let densities = Grid::new(densities).with_grid_columns(columns).with_name("States visited: all episodes");
        let lines = Grid::new(lines).with_grid_columns(columns).with_name("States visited: latest episodes");
        Tabs::new([densities.into(), lines.into()]).into()
    }

    fn lines(&mut self, layout: &Layout<'_>, agent: u32) -> ContainerLike {
        let name = format!("Agent {agent}: states in the latest {} episodes", layout.quota.window);
        let view = self.parallel_coordinates(layout, layout.lettering(), name, format!("/visitation/agent_{agent}/lines"));
        self.property(&view, "VisibleTimeRanges", VisibleTimeRanges::new(windows(layout)));
        view
    }

    fn density(&mut self, layout: &Layout<'_>, agent: u32) -> ContainerLike {
        let name = format!("Agent {agent}: all states so far");
        self.parallel_coordinates(layout, layout.lettering(), name, format!("/visitation/agent_{agent}/density"))
    }

    fn parallel_coordinates(&mut self, layout: &Layout<'_>, lettering: Lettering, name: String, entity: String) -> ContainerLike {
        let words = if lettering == layout.wide_lettering() { "/visitation/axes/labels" } else { "/visitation/axes/names" };
        let contents = ["/visitation/axes".to_owned(), words.to_owned(), entity];
        let view: ContainerLike = Spatial2DView::new(name).with_origin("/visitation").with_contents(contents).into();
        let x_range = [f64::from(-MARGIN), layout.axes.width() as f64 + f64::from(MARGIN)];
        let bounds = Range2D { x_range: x_range.into(), y_range: lettering.y_range().into() };
        self.property(&view, "VisualBounds2D", VisualBounds2D::new(bounds));
        self.background(&view);
        view
    }

    fn learned(&mut self, layout: &Layout<'_>) -> ContainerLike {
        let name = "Returns: each agent, and the team's mean of 25 rounds in white";
        let returns: ContainerLike = TimeSeriesView::new(name).with_origin("/curves/return").into();
        let legend = PlotLegend::new().with_corner(Corner2D::RightBottom).with_visible(layout.agents <= AGENTS_IN_LEGEND);
        self.property(&returns, "PlotLegend", legend);
        self.all_times(&returns);
        let updates: Vec<_> = UPDATE_CURVES.iter().chain(&TEAM_CURVES).map(|(name, _)| self.update(name)).collect();
        let team = self.team(layout);
        let mut rest = vec![team, TextDocumentView::new("Scenario").with_origin("/scenario").into()];
        if let Some(scenes) = self.scenes(layout) {
            rest.insert(0, scenes);
        }
        Vertical::new([returns, Tabs::new(updates).into(), Tabs::new(rest).into()]).with_row_shares([3.0, 2.0, 3.0]).into()
    }

    fn team(&mut self, layout: &Layout<'_>) -> ContainerLike {
        let (name, entity) = ("Team: all states so far".to_owned(), "/visitation/team/density".to_owned());
        self.parallel_coordinates(layout, layout.wide_lettering(), name, entity)
    }

    fn update(&mut self, curve: &str) -> ContainerLike {
        let view: ContainerLike = TimeSeriesView::new(title(curve)).with_origin(format!("/curves/{curve}")).into();
        self.property(&view, "PlotLegend", PlotLegend::new().with_visible(false));
        self.all_times(&view);
        if curve == "clipped_fraction" {
            self.property(&view, "ScalarAxis", ScalarAxis::new().with_range(Range1D::new(0.0, 1.0)));
        }
        view
    }

    /// From the first to the last moment, on any timeline.
    fn all_times(&mut self, view: &ContainerLike) {
        let always = TimeRange { start: TimeRangeBoundary::Infinite, end: TimeRangeBoundary::Infinite };
        self.property(view, "TimeAxis", TimeAxis::new().with_view_range(always));
    }

    fn scene(&mut self, filmed: &Filmed) -> ContainerLike {
        let name = format!("Agent {} in motion", filmed.agent);
        let view = Spatial2DView::new(name).with_origin(filmed.origin.as_str());
        let view: ContainerLike = view.with_contents([format!("/scene/agent_{}/**", filmed.agent)]).into();
        if let Some([left, right, top, bottom]) = filmed.bounds.map(|bounds| bounds.map(f64::from)) {
            let bounds = Range2D { x_range: [left, right].into(), y_range: [top, bottom].into() };
            self.property(&view, "VisualBounds2D", VisualBounds2D::new(bounds));
        }
        self.background(&view);
        view
    }

    fn background(&mut self, view: &ContainerLike) {
        self.property(view, "Background", Background::new(BackgroundKind::SolidColor).with_color(rgb(BACKGROUND)));
    }

    fn property(&mut self, view: &ContainerLike, name: &str, property: impl AsComponents + 'static) {
        if let ContainerLike::View(view) = view {
            self.properties.push((view.blueprint_path().join(&name.into()), Box::new(property)));
        }
    }
}

/// `clipped_fraction` becomes `Clipped fraction`.
fn title(curve: &str) -> String {
    let words = curve.replace('_', " ");
    words[..1].to_uppercase() + &words[1..]
}

/// The latest episodes. An episode takes at least two steps, so that half as many steps hold no more.
fn windows(layout: &Layout<'_>) -> [VisibleTimeRange; 3] {
    let latest = |timeline: &str, length: u32| VisibleTimeRange {
        timeline: timeline.into(),
        range: TimeRange {
            start: TimeRangeBoundary::CursorRelative(TimeInt(1 - i64::from(length))),
            end: TimeRangeBoundary::CursorRelative(TimeInt(0)),
        },
    };
    let window = layout.quota.window;
    [latest(EPISODE, window), latest(ROUND, window), latest(ENV_STEP, (2 * window).max(layout.time_limit + 1))]
}
