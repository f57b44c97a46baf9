//! Shards: the runs of a study divided among processes that know nothing of each other.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use crate::study::design::cell::PlannedRun;

/// Maximum cost of the runs that stay together in a shard, as a share of its mean cost.
const MAX_SHARE_TOGETHER: f64 = 0.25;

/// One of `count` shards of a study, such as `3/40`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Shard {
    /// The runs of this shard, in the order of `runs`. The shards of a study have about equal costs,
    /// and depend on nothing but the study.
    #[must_use]
    pub fn runs_of<'a>(self, runs: &[PlannedRun<'a>]) -> Vec<PlannedRun<'a>> {
        let items: Vec<Item<'_>> = runs.iter().map(Item::of).collect();
        let shards = shards_of(&items, self.count);
        let own = runs
            .iter()
            .zip(shards)
            .filter(|(_, shard)| *shard == self.index);
        own.map(|(run, _)| *run).collect()
    }
}

impl Display for Shard {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (index, count) = text.split_once('/').ok_or_else(|| expected_form(text))?;
        let number = |text: &str| text.parse::<u32>().map_err(|_| expected_form(text));
        let (index, count) = (number(index)?, number(count)?);
        if count == 0 {
            return Err("the number of shards is 0; expected at least 1".to_owned());
        }
        if index >= count {
            return Err(format!(
                "there is no shard {index} of {count}: shards are counted from 0 to {}",
                count - 1
            ));
        }
        Ok(Self { index, count })
    }
}

fn expected_form(text: &str) -> String {
    if text.is_empty() {
        return "a number is missing; expected I/N such as 3/40 (is the environment variable of the index set?)"
            .to_owned();
    }
    format!("`{text}` is not the number of a shard; expected I/N such as 3/40")
}

/// What the division depends on of one run.
struct Item<'a> {
    cell: &'a str,
    cost: f64,
    /// Number of runs of the cell that take the least time together.
    together: usize,
}

impl<'a> Item<'a> {
    fn of(run: &PlannedRun<'a>) -> Self {
        Self {
            cell: run.cell.digest(),
            cost: run.cell.source.cost().max(0.0),
            together: run.cell.source.runs_together(),
        }
    }
}

/// The shard of each item. The most expensive chunk goes first, each to the shard with the least cost
/// so far (Graham 1969: longest processing time first).
fn shards_of(items: &[Item<'_>], count: u32) -> Vec<u32> {
    let total: f64 = items.iter().map(|item| item.cost).sum();
    let mut chunks = chunks(items, total / f64::from(count) * MAX_SHARE_TOGETHER);
    let cost = |chunk: &[usize]| chunk.iter().map(|&index| items[index].cost).sum::<f64>();
    chunks.sort_by(|a, b| cost(b).total_cmp(&cost(a)));
    // The bits of non-negative numbers are ordered as the numbers. With more shards than chunks, the
    // last ones stay empty.
    let used = count.min(u32::try_from(chunks.len()).unwrap_or(count));
    let mut loads: BinaryHeap<Reverse<(u64, u32)>> =
        (0..used).map(|shard| Reverse((0, shard))).collect();
    let mut shards = vec![0; items.len()];
    for chunk in chunks {
        if let Some(Reverse((load, shard))) = loads.pop() {
            let load = f64::from_bits(load) + cost(&chunk);
            loads.push(Reverse((load.to_bits(), shard)));
            for index in chunk {
                shards[index] = shard;
            }
        }
    }
    shards
}

/// Consecutive items of one cell that are faster together, up to this cost; single items if they cost
/// more.
fn chunks(items: &[Item<'_>], max_cost: f64) -> Vec<Vec<usize>> {
    let mut chunks: Vec<Vec<usize>> = Vec::new();
    for (index, item) in items.iter().enumerate() {
        let affordable = (max_cost / item.cost) as usize;
        let max_length = item.together.min(affordable);
        match chunks.last_mut() {
            Some(chunk) if chunk.len() < max_length && items[chunk[0]].cell == item.cell => {
                chunk.push(index);
            }
            _ => chunks.push(vec![index]),
        }
    }
    chunks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn items(cells: &[(&'static str, f64, usize, usize)]) -> Vec<Item<'static>> {
        let of_cell = |&(cell, cost, together, runs): &(&'static str, f64, usize, usize)| {
            (0..runs).map(move |_| Item {
                cell,
                cost,
                together,
            })
        };
        cells.iter().flat_map(of_cell).collect()
    }

    fn loads(items: &[Item<'_>], shards: &[u32], count: u32) -> Vec<f64> {
        let load = |shard| {
            let own = items.iter().zip(shards).filter(move |(_, s)| **s == shard);
            own.map(|(item, _)| item.cost).sum()
        };
        (0..count).map(load).collect()
    }

    /// By hand: 7 | 6 | 5, then 4 to the third (9), 3 to the second (9), 2 to the first (9).
    #[test]
    fn the_longest_run_goes_to_the_emptiest_shard() {
        let items = items(&[
            ("a", 2.0, 1, 1),
            ("b", 3.0, 1, 1),
            ("c", 4.0, 1, 1),
            ("d", 5.0, 1, 1),
            ("e", 6.0, 1, 1),
            ("f", 7.0, 1, 1),
        ]);
        assert_eq!(shards_of(&items, 3), [0, 1, 2, 2, 1, 0]);
    }

    #[test]
    fn as_many_shards_as_runs_have_one_run_each() {
        let items = items(&[("a", 9.0, 16, 20), ("b", 10.0, 4, 20)]);
        for count in [40, 41, 1001] {
            let mut shards = shards_of(&items, count);
            shards.sort_unstable();
            assert_eq!(shards, (0..40).collect::<Vec<_>>(), "{count}");
        }
    }

    #[test]
    fn shards_are_balanced_and_keep_runs_of_a_cell_together() {
        let items = items(&[
            ("a", 1.0, 8, 200),
            ("b", 3.0, 8, 100),
            ("c", 10.0, 1, 50),
            ("d", 0.5, 8, 100),
        ]);
        let mean = 1050.0 / 10.0;
        let shards = shards_of(&items, 10);
        for load in loads(&items, &shards, 10) {
            assert!((load - mean).abs() < 0.25 * mean, "{load}");
        }
        let changes = shards[..200].windows(2).filter(|two| two[0] != two[1]);
        assert!(changes.count() < 200 / 8);
    }

    #[test]
    fn numbers_of_shards_are_checked() {
        let parse = str::parse::<Shard>;
        assert_eq!(parse("3/40").unwrap().to_string(), "3/40");
        for (text, part) in [
            ("4/4", "counted from 0 to 3"),
            ("0/0", "number of shards is 0"),
            ("/40", "is the environment variable"),
            ("3/", "is the environment variable"),
            ("3", "`3` is not the number of a shard"),
            ("x/4", "`x` is not the number of a shard"),
            ("-1/4", "`-1` is not the number of a shard"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
