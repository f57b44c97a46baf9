//! The table of metrics: everything that is measured of a run, and where it appears.
//!
//! A metric is one entry of the table below. From it derive its column of `rounds.csv` (the field of
//! [`RoundRow`]), its curve in the recording (`/curves/KEY`), its panel of `seedbed plot`, its
//! [`Curve`] in studies, its title in figures and reports, and its row of the table in the README.
//! Adding a metric means adding an entry here and computing its value where a [`RoundRow`] is made.
//!
//! A metric that an algorithm or a round does not have is `None`, never 0: an empty cell of
//! `rounds.csv`, no point of a curve, and not measured in studies.

use serde::{Deserialize, Serialize};

/// What is measured, and how it is shown.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Name of the column, and of the entity below `/curves`.
    pub key: &'static str,
    /// Name in figures and reports, in lower case.
    pub title: &'static str,
    /// Unit; empty for pure numbers.
    pub unit: &'static str,
    /// Definition, in a sentence or two.
    pub description: &'static str,
    /// Name in study files.
    pub curve: Curve,
    /// Whose number it is.
    pub scope: Scope,
    /// Values that it can have.
    pub range: Range,
    /// How the numbers of all agents of a round become one.
    pub over_agents: OverAgents,
    /// Which runs have it.
    pub runs: Runs,
    /// What it is about. Metrics are shown in the order of these groups.
    pub group: Group,
    /// Where its values come from.
    pub source: Source,
    /// Whether the recording has a curve of it.
    pub recorded: bool,
    /// Whether `seedbed plot` has a panel of it.
    pub plotted: bool,
    /// Whether its axis shows the whole range instead of the values alone.
    pub full_axis: bool,
}

/// Whose number a metric is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Each agent has its own.
    Agent,
    /// One number for the whole team, repeated in the row of each agent.
    Team,
}

/// Values that a metric can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// Any number.
    Any,
    /// At least 0.
    NotNegative,
    /// At least 1.
    FromOne,
    /// A share, from 0 to 1: it means the same in every task.
    Share,
    /// A correlation, from −1 to 1.
    Correlation,
    /// A number of agents, from 1 to K.
    Agents,
}

/// How the numbers of all agents of a round become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OverAgents {
    /// Their mean.
    Mean,
    /// The largest of them.
    Max,
}

/// Which runs have a metric.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Runs {
    /// All.
    All,
    /// Those in which agents with networks learn round by round.
    Training,
    /// Those of teams in tabular tasks.
    Tabular,
}

/// What a metric is about, in the order in which metrics are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// Rewards.
    Rewards,
    /// Where an agent has been.
    Visits,
    /// How random its actions are.
    Policy,
    /// What it is curious about.
    Curiosity,
    /// How far policies are from those that acted.
    Ratios,
    /// What networks still get wrong.
    Losses,
    /// How the agents of the team differ.
    Team,
}

/// Where the values of a metric come from.
#[derive(Clone, Copy, Debug)]
pub enum Source {
    /// Each episode of each agent has one.
    Episode,
    /// Each update of each agent has one, in a row of `rounds.csv`; `None` where it is not measured.
    Round(fn(&RoundRow) -> Option<f64>),
}

/// What most metrics have in common.
const USUAL: Metric = Metric {
    key: "",
    title: "",
    unit: "",
    description: "",
    curve: Curve::Return,
    scope: Scope::Agent,
    range: Range::Any,
    over_agents: OverAgents::Mean,
    runs: Runs::Training,
    group: Group::Rewards,
    source: Source::Episode,
    recorded: true,
    plotted: false,
    full_axis: false,
};

/// A number of a row, if it was measured.
trait Reading: Copy {
    fn measured(self) -> Option<f64>;
}

impl Reading for f64 {
    fn measured(self) -> Option<f64> {
        Some(self)
    }
}

impl Reading for Option<f32> {
    fn measured(self) -> Option<f64> {
        self.map(f64::from)
    }
}

/// Makes [`RoundRow`], [`Curve`] and the table [`METRICS`] of the entries. The order of `rounds` is
/// that of the columns of `rounds.csv`.
macro_rules! metrics {
    (
        episodes { $( $(#[doc = $episode_doc:literal])+ $episode_key:literal as $episode_curve:ident { $($episode_field:ident: $episode_value:expr),* } )* }
        rounds { $( $(#[doc = $doc:literal])+ $key:ident: $type:ty as $curve:ident { $($field:ident: $value:expr),* } )* }
    ) => {
        /// One row of `rounds.csv`: what one agent's update was like. `None` is an empty cell.
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        pub struct RoundRow {
            /// Who learned.
            pub agent: u32,
            /// Counts from 0.
            pub round: u32,
            $( $(#[doc = $doc])+ pub $key: $type, )*
        }

        /// A metric as study files name it: what is followed through a run.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Curve {
            $( $(#[doc = $episode_doc])+ $episode_curve, )*
            $( $(#[doc = $doc])+ $curve, )*
        }

        impl Curve {
            /// Curves with one value per round, in the order of the columns of `rounds.csv`, in
            /// which a study keeps them.
            pub const OF_ROUNDS: &[Self] = &[$( Self::$curve, )*];
        }

        /// All metrics: first those of episodes, then those of rounds.
        pub const METRICS: &[Metric] = &[
            $( Metric {
                key: $episode_key,
                description: concat!($($episode_doc),+),
                curve: Curve::$episode_curve,
                $($episode_field: $episode_value,)*
                ..USUAL
            }, )*
            $( Metric {
                key: stringify!($key),
                description: concat!($($doc),+),
                curve: Curve::$curve,
                source: Source::Round(|row| row.$key.measured()),
                $($field: $value,)*
                ..USUAL
            }, )*
        ];
    };
}

metrics! {
    episodes {
        /// Sum of the environment's rewards in one episode.
        "return" as Return { title: "return", runs: Runs::All }
        /// What the best policy earns in one episode beyond what the agent's actions earn on average.
        "regret" as Regret { title: "regret per episode", range: Range::NotNegative, runs: Runs::Tabular }
    }
    rounds {
        /// Half the mean squared error of the value function against its (normalized) target.
        value_loss: Option<f32> as ValueLoss {
            title: "value loss", range: Range::NotNegative, group: Group::Losses, plotted: true
        }
        /// Surrogate loss of the policy.
        policy_loss: Option<f32> as PolicyLoss { title: "policy loss", group: Group::Losses }
        /// Mean |ρ − 1| + 1 of the importance ratios ρ (thesis Fig. 5.4).
        ratio_deviation: Option<f32> as RatioDeviation {
            title: "ratio deviation", range: Range::FromOne, group: Group::Ratios, plotted: true
        }
        /// Largest importance ratio ρ of all samples.
        largest_ratio: Option<f32> as LargestRatio {
            title: "largest ratio", range: Range::NotNegative, group: Group::Ratios,
            over_agents: OverAgents::Max
        }
        /// Share of samples with zero policy gradient because of clipping.
        clipped_fraction: Option<f32> as ClippedFraction {
            title: "clipped fraction", range: Range::Share, group: Group::Ratios, plotted: true,
            full_axis: true
        }
        /// Mean entropy of the policy.
        entropy: Option<f32> as Entropy {
            title: "policy entropy", unit: "nats", group: Group::Policy, plotted: true
        }
        /// Mean bonus per step of the agent's own.
        intrinsic_reward: Option<f32> as IntrinsicReward {
            title: "intrinsic reward per step", group: Group::Curiosity, plotted: true
        }
        /// Mean squared error of the dynamics model on fresh episodes, before it learned from them.
        /// That of the first round is in raw units, because nothing is known yet to normalize by.
        prediction_error: Option<f32> as PredictionError {
            title: "prediction error", range: Range::NotNegative, group: Group::Curiosity, plotted: true
        }
        /// Mean rank correlation between the bonuses that different agents give to the same steps.
        /// Needs two agents with models of their own.
        bonus_agreement: Option<f32> as BonusAgreement {
            title: "bonus agreement", range: Range::Correlation, group: Group::Curiosity, plotted: true
        }
        /// Share of the state space that the agent has visited so far.
        coverage: f64 as Coverage {
            title: "coverage per agent", range: Range::Share, runs: Runs::All, group: Group::Visits,
            plotted: true
        }
        /// Entropy of the agent's visits so far.
        visitation_entropy: f64 as VisitationEntropy {
            title: "visitation entropy", unit: "nats", range: Range::NotNegative, group: Group::Visits
        }
        /// That entropy as a share of the largest possible one.
        visitation_evenness: f64 as VisitationEvenness {
            title: "visitation evenness", range: Range::Share, group: Group::Visits, recorded: false,
            plotted: true
        }
        /// Share of the state space that any agent has visited so far.
        team_coverage: f64 as TeamCoverage {
            title: "team coverage", range: Range::Share, scope: Scope::Team, runs: Runs::All,
            group: Group::Team
        }
        /// How alike the agents' visits are: 0 if no two agents visit the same states.
        team_overlap: f64 as TeamOverlap {
            title: "team overlap", range: Range::Share, scope: Scope::Team, runs: Runs::All,
            group: Group::Team
        }
        /// How many agents without any overlap would differ as much.
        effective_agents: f64 as EffectiveAgents {
            title: "effective agents", range: Range::Agents, scope: Scope::Team, runs: Runs::All,
            group: Group::Team, plotted: true
        }
    }
}

impl Metric {
    /// Title with the unit, such as `policy entropy (nats)`.
    #[must_use]
    pub fn label(&self) -> String {
        if self.unit.is_empty() {
            self.title.to_owned()
        } else {
            format!("{} ({})", self.title, self.unit)
        }
    }

    /// The value of an update, if it has one. Metrics of episodes have none.
    #[must_use]
    pub fn value(&self, row: &RoundRow) -> Option<f64> {
        match self.source {
            Source::Episode => None,
            Source::Round(value) => value(row),
        }
    }

    /// One value of all agents' updates in a round; `None` if no agent has one.
    #[must_use]
    pub fn value_of_round(&self, updates: &[RoundRow]) -> Option<f64> {
        let values: Vec<f64> = updates.iter().filter_map(|row| self.value(row)).collect();
        if values.is_empty() {
            return None;
        }
        Some(match self.over_agents {
            OverAgents::Mean => values.iter().sum::<f64>() / values.len() as f64,
            OverAgents::Max => values.into_iter().fold(f64::NEG_INFINITY, f64::max),
        })
    }

    /// Whether it has a value per update, and so a column of `rounds.csv`.
    #[must_use]
    pub fn is_of_rounds(&self) -> bool {
        matches!(self.source, Source::Round(_))
    }
}

/// Metrics with a column of `rounds.csv`, in the order of the columns.
pub fn of_rounds() -> impl Iterator<Item = &'static Metric> {
    METRICS.iter().filter(|metric| metric.is_of_rounds())
}

/// Metrics with a column of `rounds.csv`, in the order in which they are shown.
#[must_use]
pub fn in_display_order() -> Vec<&'static Metric> {
    let mut metrics: Vec<&'static Metric> = of_rounds().collect();
    metrics.sort_by_key(|metric| metric.group);
    metrics
}

#[allow(
    clippy::derivable_impls,
    reason = "the macro cannot mark one of the variants that it makes"
)]
impl Default for Curve {
    fn default() -> Self {
        Self::Return
    }
}

impl Curve {
    /// Its entry of the table.
    #[must_use]
    pub fn metric(self) -> &'static Metric {
        // Variants are numbered in the order of the entries.
        &METRICS[self as usize]
    }
}

/// The table of the README, in Markdown: one row per column of `rounds.csv`.
#[must_use]
pub fn markdown() -> String {
    let head = "| Column of `rounds.csv` | Meaning | Range | Unit | Of | Name in studies |\n\
                |---|---|---|---|---|---|\n";
    let mut table = head.to_owned();
    for metric in of_rounds() {
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

    /// An update of which nothing is measured but visits.
    fn bare() -> RoundRow {
        let mut columns: Vec<&str> = of_rounds().map(|metric| metric.key).collect();
        let mut cells: Vec<&str> = of_rounds()
            .map(|metric| match metric.group {
                Group::Visits | Group::Team => "0.5",
                _ => "",
            })
            .collect();
        columns.extend(["agent", "round"]);
        cells.extend(["3", "7"]);
        read(&format!("{}\n{}\n", columns.join(","), cells.join(",")))
    }

    fn read(table: &str) -> RoundRow {
        let mut reader = csv::Reader::from_reader(table.as_bytes());
        reader.deserialize().next().unwrap().unwrap()
    }

    fn written(row: &RoundRow) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.serialize(row).unwrap();
        String::from_utf8(writer.into_inner().unwrap()).unwrap()
    }

    #[test]
    fn curves_find_their_entries() {
        for metric in METRICS {
            assert_eq!(metric.curve.metric().key, metric.key);
        }
    }

    #[test]
    fn columns_are_the_keys_of_metrics() {
        let keys: Vec<&str> = of_rounds().map(|metric| metric.key).collect();
        let header = format!("agent,round,{}", keys.join(","));
        assert_eq!(written(&bare()).lines().next(), Some(header.as_str()));
    }

    #[test]
    fn what_is_not_measured_is_an_empty_cell() {
        let row = bare();
        assert_eq!((row.value_loss, row.intrinsic_reward), (None, None));
        let text = written(&row);
        assert_eq!(
            text.lines().nth(1),
            Some("3,7,,,,,,,,,,0.5,0.5,0.5,0.5,0.5,0.5")
        );
        assert_eq!(read(&text), row);
    }

    /// Tables of older versions have numbers where nothing was measured.
    #[test]
    fn zeros_of_older_tables_are_numbers() {
        let table = written(&bare()).replace(",,,,,,,,,,", ",0.0,0,1,1,0,0.6,0,0,,");
        let row = read(&table);
        assert_eq!((row.value_loss, row.entropy), (Some(0.0), Some(0.6)));
        assert_eq!(row.bonus_agreement, None);
    }

    #[test]
    fn a_round_is_measured_by_the_agents_that_have_a_value() {
        let with = |entropy, largest_ratio| RoundRow {
            entropy,
            largest_ratio,
            ..bare()
        };
        let updates = [
            with(Some(1.0), Some(2.0)),
            with(None, None),
            with(Some(2.0), Some(5.0)),
        ];
        let value = |curve: Curve| curve.metric().value_of_round(&updates);
        assert_eq!(value(Curve::Entropy), Some(1.5));
        assert_eq!(value(Curve::LargestRatio), Some(5.0));
        assert_eq!(value(Curve::PolicyLoss), None);
    }

    /// With `UPDATE_EXPECT=1` the table is written.
    #[test]
    fn the_page_on_recordings_has_this_table() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/recording.md");
        let page = std::fs::read_to_string(&path).unwrap();
        let (before, rest) = page.split_once("<!-- metrics:begin -->\n").unwrap();
        let (table, after) = rest.split_once("<!-- metrics:end -->").unwrap();
        if std::env::var_os("UPDATE_EXPECT").is_some() {
            let marked = format!("<!-- metrics:begin -->\n{}<!-- metrics:end -->", markdown());
            std::fs::write(&path, format!("{before}{marked}{after}")).unwrap();
        } else {
            assert_eq!(table, markdown(), "run `cargo xtask bless`");
        }
    }

    #[test]
    fn metrics_are_shown_group_by_group() {
        let keys: Vec<&str> = in_display_order()
            .iter()
            .filter(|metric| metric.recorded)
            .map(|metric| metric.key)
            .collect();
        assert_eq!(
            keys,
            [
                "coverage",
                "visitation_entropy",
                "entropy",
                "intrinsic_reward",
                "prediction_error",
                "bonus_agreement",
                "ratio_deviation",
                "largest_ratio",
                "clipped_fraction",
                "value_loss",
                "policy_loss",
                "team_coverage",
                "team_overlap",
                "effective_agents"
            ]
        );
    }
}
