//! The table of metrics: the numbers that are measured during a run, and where each of them
//! appears.
//!
//! A metric is one entry of the table below. The entry determines its column of `rounds.csv` (the
//! field of [`RoundRow`]), its curve in the recording (`/curves/KEY`), its panel of `seedbed plot`,
//! its [`Curve`] in studies, its title in figures and reports, and its row of the table in the
//! README. Adding a metric means adding an entry here and computing its value where a [`RoundRow`]
//! is made.
//!
//! A metric that an algorithm or a round does not have is `None`, never 0: an empty cell of
//! `rounds.csv`, no point of a curve, and not measured in studies.

use serde::{Deserialize, Serialize};

/// A number that is measured during a run, with its name, unit, range and the places where it is
/// shown.
#[derive(Clone, Copy, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "a row of the table of metrics; each is a column"
)]
pub struct Metric {
    /// Name of its column in `rounds.csv` and of its entity below `/curves`.
    pub key: &'static str,
    /// Name in figures and reports, in lower case.
    pub title: &'static str,
    /// Unit; empty for pure numbers.
    pub unit: &'static str,
    /// Definition of the metric, as text.
    pub description: &'static str,
    /// Name in study files.
    pub curve: Curve,
    /// Whether each agent or the team has a value.
    pub scope: Scope,
    /// Range of possible values.
    pub range: Range,
    /// How the values of all agents in a round are combined into one value.
    pub team_aggregation: TeamAggregation,
    /// The kind of runs that have this metric.
    pub runs: RunKind,
    /// Subject of the metric. Metrics are shown in the order of their groups.
    pub group: Group,
    /// Source of its values.
    pub source: Source,
    /// Whether recordings have a curve of this metric.
    pub recorded: bool,
    /// Whether `seedbed plot` draws a panel of this metric.
    pub plotted: bool,
    /// Whether axes show the whole range of possible values instead of the range of the data.
    pub axis_shows_full_range: bool,
    /// Whether a value is of everything up to its round. Such curves are not averaged over episodes: the
    /// average would be of an earlier time.
    pub is_cumulative: bool,
}

/// Whether each agent or the team has a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Each agent has its own value.
    Agent,
    /// The team has one value, which is repeated in the row of each agent.
    Team,
}

/// Range of the possible values of a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Any number.
    Any,
    /// At least 0.
    NotNegative,
    /// At least 1.
    FromOne,
    /// A share from 0 to 1, which can be compared between tasks.
    Share,
    /// A correlation, from −1 to 1.
    Correlation,
    /// A number of agents, from 1 to the number of agents K.
    Agents,
}

/// How the values of all agents in a round are combined into one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TeamAggregation {
    /// Mean over agents.
    Mean,
    /// Sum over agents.
    Sum,
    /// Maximum over agents.
    Max,
}

/// The kind of runs that have a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunKind {
    /// All runs.
    All,
    /// Runs in which agents with networks learn in rounds.
    Training,
    /// Runs of tabular scenarios.
    Tabular,
}

/// Subjects of metrics, in the order in which metrics are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Rewards.
    Rewards,
    /// The states that an agent has visited.
    Visits,
    /// The coverage and the diversity of the team.
    Team,
    /// The randomness of an agent's policy.
    Policy,
    /// Bonuses and the dynamics models behind them.
    Curiosity,
    /// Importance ratios between the current policy and the policies that acted.
    Ratios,
    /// Losses of the networks.
    Losses,
}

/// Source of the values of a metric.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// Each episode of each agent has a value.
    Episode,
    /// Each update of each agent has a value in its row of `rounds.csv`, or `None` if the metric
    /// was not measured.
    Round(fn(&RoundRow) -> Option<f64>),
}

/// Default values of the fields of a metric.
const DEFAULT_METRIC: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    description: "",
    curve: Curve::Return,
    scope: Scope::Agent,
    range: Range::Any,
    team_aggregation: TeamAggregation::Mean,
    runs: RunKind::Training,
    group: Group::Rewards,
    source: Source::Episode,
    recorded: true,
    plotted: false,
    axis_shows_full_range: false,
    is_cumulative: false,
};

/// A field of a row: a number, or `None` if it was not measured.
trait MaybeMeasured: Copy {
    fn as_measured(self) -> Option<f64>;
}

impl MaybeMeasured for f64 {
    fn as_measured(self) -> Option<f64> {
        Some(self)
    }
}

impl MaybeMeasured for Option<f64> {
    fn as_measured(self) -> Option<f64> {
        self
    }
}

impl MaybeMeasured for Option<f32> {
    fn as_measured(self) -> Option<f64> {
        self.map(f64::from)
    }
}

/// Defines [`RoundRow`], [`Curve`] and [`METRICS`] from a list of entries. The entries of `rounds`
/// are in the order of the columns of `rounds.csv`.
macro_rules! metrics {
    (
        episodes { $( $(#[doc = $episode_doc:literal])+ $episode_key:literal as $episode_curve:ident { $($episode_field:ident: $episode_value:expr),* } )* }
        rounds { $( $(#[doc = $doc:literal])+ $key:ident: $type:ty as $curve:ident { $($field:ident: $value:expr),* } )* }
    ) => {
        /// One row of `rounds.csv`: the metrics of one update of one agent. `None` is an empty
        /// cell.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub struct RoundRow {
            /// Number of the agent that was updated, from 0.
            pub agent: u32,
            /// Number of the round, from 0.
            pub round: u32,
            $( $(#[doc = $doc])+ pub $key: $type, )*
        }

        /// A metric in study files, as a curve over the course of a run.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Curve {
            $( $(#[doc = $episode_doc])+ $episode_curve, )*
            $( $(#[doc = $doc])+ $curve, )*
        }

        impl Curve {
            /// Curves with one value per round, in the order of the columns of `rounds.csv`. Stored
            /// runs of studies have the same order.
            pub const WITH_ROUND_VALUES: &[Self] = &[$( Self::$curve, )*];
        }

        /// All metrics: first the metrics of episodes, then the metrics of rounds.
        pub const METRICS: &[Metric] = &[
            $( Metric {
                key: $episode_key,
                description: concat!($($episode_doc),+),
                curve: Curve::$episode_curve,
                $($episode_field: $episode_value,)*
                ..DEFAULT_METRIC
            }, )*
            $( Metric {
                key: stringify!($key),
                description: concat!($($doc),+),
                curve: Curve::$curve,
                source: Source::Round(|row| row.$key.as_measured()),
                $($field: $value,)*
                ..DEFAULT_METRIC
            }, )*
        ];
    };
}

metrics! {
    episodes {
        /// Sum of the environment's rewards in one episode.
        "return" as Return { title: "return", runs: RunKind::All }
        /// Expected return of the optimal policy minus expected return of the agent's actions, in
        /// one episode.
        "regret" as Regret { title: "regret per episode", range: Range::NotNegative, runs: RunKind::Tabular }
    }
    rounds {
        /// Number of gradient steps of the agent's networks in this update. Steps of networks that
        /// agents share are counted for agent 0 only.
        gradient_steps: Option<f32> as GradientSteps {
            title: "gradient steps", range: Range::NotNegative, group: Group::Losses,
            team_aggregation: TeamAggregation::Sum, recorded: false
        }
        /// Half the mean squared error of the value function against its (normalized) target.
        value_loss: Option<f32> as ValueLoss {
            title: "value loss", range: Range::NotNegative, group: Group::Losses, plotted: true
        }
        /// Surrogate loss of the policy.
        policy_loss: Option<f32> as PolicyLoss { title: "policy loss", group: Group::Losses }
        /// 1 + mean of |ρ − 1| over the importance ratios ρ of all samples (thesis Fig. 5.4).
        ratio_deviation: Option<f32> as RatioDeviation {
            title: "ratio deviation", range: Range::FromOne, group: Group::Ratios, plotted: true
        }
        /// Largest importance ratio ρ of all samples.
        largest_ratio: Option<f32> as LargestRatio {
            title: "largest ratio", range: Range::NotNegative, group: Group::Ratios,
            team_aggregation: TeamAggregation::Max
        }
        /// Share of samples whose policy gradient is 0 because of clipping.
        clipped_fraction: Option<f32> as ClippedFraction {
            title: "clipped fraction", range: Range::Share, group: Group::Ratios, plotted: true,
            axis_shows_full_range: true
        }
        /// Mean entropy of the policy.
        entropy: Option<f32> as Entropy {
            title: "policy entropy", unit: "nats", group: Group::Policy, plotted: true
        }
        /// Mean bonus of the agent's own steps.
        intrinsic_reward: Option<f32> as IntrinsicReward {
            title: "intrinsic reward per step", group: Group::Curiosity, plotted: true
        }
        /// Mean squared error of the dynamics model on new episodes, before it is trained on them.
        /// In the first round the error is not normalized, because there are no statistics yet.
        prediction_error: Option<f32> as PredictionError {
            title: "prediction error", range: Range::NotNegative, group: Group::Curiosity, plotted: true
        }
        /// Mean rank correlation between the bonuses that different agents give to the same steps.
        /// Measured if at least two agents have models that can differ: not with a shared model of `Rnd` or
        /// `TeamEntropy`, or of `Regions` with `others: 1`, which gives the same bonuses to all. With a shared model of `Vime` without
        /// seeds, agents differ in their random draws of the weights only.
        bonus_agreement: Option<f32> as BonusAgreement {
            title: "bonus agreement", range: Range::Correlation, group: Group::Curiosity, plotted: true
        }
        /// Share of the state space that the agent has visited so far.
        coverage: f64 as Coverage {
            title: "coverage per agent", range: Range::Share, runs: RunKind::All, group: Group::Visits,
            plotted: true,
            is_cumulative: true
        }
        /// Entropy of the agent's visits so far.
        visitation_entropy: f64 as VisitationEntropy {
            title: "visitation entropy", unit: "nats", range: Range::NotNegative, group: Group::Visits,
            is_cumulative: true
        }
        /// Entropy of the agent's visits as a share of the largest possible entropy.
        visitation_evenness: f64 as VisitationEvenness {
            title: "visitation evenness", range: Range::Share, group: Group::Visits, recorded: false,
            plotted: true,
            is_cumulative: true
        }
        /// Share of the state space that any agent has visited so far.
        team_coverage: f64 as TeamCoverage {
            title: "team coverage", range: Range::Share, scope: Scope::Team, runs: RunKind::All,
            group: Group::Team,
            is_cumulative: true
        }
        /// Overlap of the agents' visits: 0 if no two agents visit the same states, 1 if all visit
        /// the same.
        team_overlap: f64 as TeamOverlap {
            title: "team overlap", range: Range::Share, scope: Scope::Team, runs: RunKind::All,
            group: Group::Team,
            is_cumulative: true
        }
        /// Effective number of agents: number of agents without overlap that would be equally
        /// diverse.
        effective_agents: f64 as EffectiveAgents {
            title: "effective agents", range: Range::Agents, scope: Scope::Team, runs: RunKind::All,
            group: Group::Team, plotted: true,
            is_cumulative: true
        }
        /// Overlap of the agents' visits in the latest 10 rounds.
        recent_overlap: Option<f64> as RecentOverlap {
            title: "recent overlap", range: Range::Share, scope: Scope::Team, group: Group::Team,
            recorded: false
        }
        /// Effective number of agents by their visits in the latest 10 rounds.
        recent_effective_agents: Option<f64> as RecentEffectiveAgents {
            title: "recent effective agents", range: Range::Agents, scope: Scope::Team,
            group: Group::Team, plotted: true
        }
        /// Share of the state space that the agent was the first to visit; shared equally with agents
        /// that visited it first in the same round. The sum over agents is the team coverage.
        first_coverage: Option<f64> as FirstCoverage {
            title: "first visits", range: Range::Share, group: Group::Visits, plotted: true,
            is_cumulative: true
        }
        /// Share of the state space that the agent was the first to visit in this round.
        new_coverage: Option<f64> as NewCoverage {
            title: "new coverage", range: Range::Share, group: Group::Visits,
            team_aggregation: TeamAggregation::Sum, recorded: false
        }
        /// Share of the state space that the team visited for the first time in this round, per 1,000
        /// environment steps of the team.
        new_coverage_rate: Option<f64> as NewCoverageRate {
            title: "new coverage per 1,000 steps", range: Range::NotNegative, scope: Scope::Team,
            group: Group::Team
        }
    }
}

impl Metric {
    /// Whether the metric counts visited cells of the display ranges of observations.
    #[must_use]
    pub fn is_of_visits(&self) -> bool {
        matches!(self.group, Group::Visits | Group::Team)
    }

    /// Title with the unit, such as `policy entropy (nats)`.
    #[must_use]
    pub fn label(&self) -> String {
        if self.unit.is_empty() {
            self.title.to_owned()
        } else {
            format!("{} ({})", self.title, self.unit)
        }
    }

    /// The value of this metric in a row; `None` if it was not measured, or if episodes have its
    /// values.
    #[must_use]
    pub fn value(&self, row: &RoundRow) -> Option<f64> {
        match self.source {
            Source::Episode => None,
            Source::Round(value) => value(row),
        }
    }

    /// The combined value of all agents in a round; `None` if no agent has a value.
    #[must_use]
    pub fn team_value_of_round(&self, updates: &[RoundRow]) -> Option<f64> {
        let values: Vec<f64> = updates.iter().filter_map(|row| self.value(row)).collect();
        if values.is_empty() {
            return None;
        }
        Some(match self.team_aggregation {
            TeamAggregation::Mean => values.iter().sum::<f64>() / values.len() as f64,
            TeamAggregation::Sum => values.iter().sum(),
            TeamAggregation::Max => values.into_iter().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    /// Whether this metric has a column of `rounds.csv`.
    #[must_use]
    pub fn has_column(&self) -> bool {
        matches!(self.source, Source::Round(_))
    }
}

/// Metrics of rounds, in the order of their columns of `rounds.csv`.
pub fn round_metrics() -> impl Iterator<Item = &'static Metric> {
    METRICS.iter().filter(|metric| metric.has_column())
}

/// Metrics of rounds, in the order in which they are shown.
#[must_use]
pub fn round_metrics_in_display_order() -> Vec<&'static Metric> {
    let mut metrics: Vec<&'static Metric> = round_metrics().collect();
    metrics.sort_by_key(|metric| metric.group);
    metrics
}

#[allow(
    clippy::derivable_impls,
    reason = "the macro cannot mark one of its variants as the default"
)]
impl Default for Curve {
    fn default() -> Self {
        Self::Return
    }
}

impl Curve {
    /// The metric of this curve.
    #[must_use]
    pub fn metric(self) -> &'static Metric {
        // The discriminants of `Curve` are indices into `METRICS`, because one macro defines both.
        &METRICS[self as usize]
    }
}

/// The table of metrics in `docs/recording.md`, as Markdown: one row per column of `rounds.csv`.
#[must_use]
pub fn markdown_table() -> String {
    let head = "| Column of `rounds.csv` | Meaning | Range | Unit | Values per | Name in studies |\n\
                |---|---|---|---|---|---|\n";
    let mut table = head.to_owned();
    for metric in round_metrics() {
        let scope = match metric.scope {
            Scope::Agent => "agent",
            Scope::Team => "team",
        };
        table += &format!(
            "| `{}` | {} | {} | {} | {scope} | `{:?}` |\n",
            metric.key,
            metric.description.trim().replace('|', "\\|"),
            metric.range,
            metric.unit,
            metric.curve,
        );
    }
    table
}

impl std::fmt::Display for Range {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Any => "any",
            Self::NotNegative => "≥ 0",
            Self::FromOne => "≥ 1",
            Self::Share => "0 to 1",
            Self::Correlation => "−1 to 1",
            Self::Agents => "1 to K",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row in which only the metrics of visits have a value.
    fn row_with_visits_only() -> RoundRow {
        let mut keys: Vec<&str> = round_metrics().map(|metric| metric.key).collect();
        let mut cells: Vec<&str> = round_metrics()
            .map(|metric| match metric.group {
                Group::Visits | Group::Team => "0.5",
                _ => "",
            })
            .collect();
        keys.extend(["agent", "round"]);
        cells.extend(["3", "7"]);
        read_row(&format!("{}\n{}\n", keys.join(","), cells.join(",")))
    }

    fn read_row(table: &str) -> RoundRow {
        let mut reader = csv::Reader::from_reader(table.as_bytes());
        reader.deserialize().next().unwrap().unwrap()
    }

    fn csv_of(row: &RoundRow) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.serialize(row).unwrap();
        String::from_utf8(writer.into_inner().unwrap()).unwrap()
    }

    #[test]
    fn every_curve_has_its_metric() {
        for metric in METRICS {
            assert_eq!(metric.curve.metric().key, metric.key);
        }
    }

    #[test]
    fn csv_columns_are_the_keys_of_metrics() {
        let keys: Vec<&str> = round_metrics().map(|metric| metric.key).collect();
        let header = format!("agent,round,{}", keys.join(","));
        assert_eq!(
            csv_of(&row_with_visits_only()).lines().next(),
            Some(header.as_str())
        );
    }

    #[test]
    fn unmeasured_values_are_empty_cells() {
        let row = row_with_visits_only();
        assert_eq!((row.value_loss, row.intrinsic_reward), (None, None));
        let text = csv_of(&row);
        assert_eq!(
            text.lines().nth(1),
            Some("3,7,,,,,,,,,,,0.5,0.5,0.5,0.5,0.5,0.5,0.5,0.5,0.5,0.5,0.5")
        );
        assert_eq!(read_row(&text), row);
    }

    /// Tables of older versions have 0 instead of empty cells for unmeasured values.
    #[test]
    fn zeros_in_tables_of_older_versions_are_read() {
        let table =
            csv_of(&row_with_visits_only()).replace(",,,,,,,,,,,", ",,0.0,0,1,1,0,0.6,0,0,,");
        let row = read_row(&table);
        assert_eq!((row.value_loss, row.entropy), (Some(0.0), Some(0.6)));
        assert_eq!(row.bonus_agreement, None);
    }

    /// Tables of older versions lack the last columns.
    #[test]
    fn columns_that_older_versions_did_not_write_are_not_measured() {
        let text = csv_of(&row_with_visits_only());
        let without_last = |line: &str| line.rsplitn(6, ',').last().unwrap_or_default().to_owned();
        let lines: Vec<String> = text.lines().map(without_last).collect();
        assert!(lines[0].ends_with(",effective_agents"), "{}", lines[0]);
        let row = read_row(&lines.join("\n"));
        assert_eq!((row.effective_agents, row.recent_overlap), (0.5, None));
    }

    #[test]
    fn team_values_ignore_agents_without_a_value() {
        let row_with = |entropy, largest_ratio| RoundRow {
            largest_ratio,
            entropy,
            ..row_with_visits_only()
        };
        let updates = [
            row_with(Some(1.0), Some(2.0)),
            row_with(None, None),
            row_with(Some(2.0), Some(5.0)),
        ];
        let value = |curve: Curve| curve.metric().team_value_of_round(&updates);
        assert_eq!(value(Curve::Entropy), Some(1.5));
        assert_eq!(value(Curve::LargestRatio), Some(5.0));
        assert_eq!(value(Curve::PolicyLoss), None);
    }

    /// With `UPDATE_EXPECT=1` this test writes the table to `docs/metrics.md`.
    #[test]
    fn the_page_of_metrics_has_their_table() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/metrics.md");
        let page = std::fs::read_to_string(&path).unwrap();
        let (text_before, text_from_table) = page.split_once("<!-- metrics:begin -->\n").unwrap();
        let (table, text_after) = text_from_table.split_once("<!-- metrics:end -->").unwrap();
        if std::env::var_os("UPDATE_EXPECT").is_some() {
            let new_section = format!(
                "<!-- metrics:begin -->\n{}<!-- metrics:end -->",
                markdown_table()
            );
            std::fs::write(&path, format!("{text_before}{new_section}{text_after}")).unwrap();
        } else {
            assert_eq!(table, markdown_table(), "run `cargo xtask bless`");
        }
    }

    #[test]
    fn metrics_of_rounds_are_shown_group_by_group() {
        let keys: Vec<&str> = round_metrics_in_display_order()
            .iter()
            .filter(|metric| metric.recorded)
            .map(|metric| metric.key)
            .collect();
        assert_eq!(
            keys,
            [
                "coverage",
                "visitation_entropy",
                "first_coverage",
                "team_coverage",
                "team_overlap",
                "effective_agents",
                "recent_effective_agents",
                "new_coverage_rate",
                "entropy",
                "intrinsic_reward",
                "prediction_error",
                "bonus_agreement",
                "ratio_deviation",
                "largest_ratio",
                "clipped_fraction",
                "value_loss",
                "policy_loss"
            ]
        );
    }
}
