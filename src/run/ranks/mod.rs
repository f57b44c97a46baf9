//! The processes over which a run is divided, and what they tell each other by MPI.
//!
//! Agents are divided into consecutive blocks, so that the order of ranks is the order of agents. Each
//! rank plays, learns, measures and records for its agents; rank 0 puts together what all have in common, and
//! writes. Numbers are copied from rank to rank, and summed on the way only if they are whole or in the order of
//! ranks, so that the bits of a run do not depend on the number of ranks. A build without the feature `mpi` has
//! [`Ranks::SINGLE`] only.
//!
//! All ranks must make the same calls in the same order. An error that only some of them meet passes
//! through [`Ranks::agree`]; the process that returns it must then end all of them.

#[cfg(feature = "mpi")]
pub mod mpi_calls;

use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// The number of this process and the number of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ranks {
    rank: u32,
    count: u32,
}

impl Default for Ranks {
    fn default() -> Self {
        Self::SINGLE
    }
}

impl Ranks {
    /// A run in one process.
    pub const SINGLE: Self = Self { rank: 0, count: 1 };

    /// Number of this process, from 0.
    #[must_use]
    pub fn rank(self) -> u32 {
        self.rank
    }

    /// Number of processes.
    #[must_use]
    pub fn count(self) -> u32 {
        self.count
    }

    /// Whether the run is in one process.
    #[must_use]
    pub fn is_single(self) -> bool {
        // A build without MPI needs no code for what several processes exchange.
        cfg!(not(feature = "mpi")) || self.count == 1
    }

    /// Whether this process writes the results.
    #[must_use]
    pub fn is_first(self) -> bool {
        self.rank == 0
    }

    /// The agents that act and learn in this process, of `agents` in all. Blocks differ in size by at
    /// most one.
    #[must_use]
    pub fn local_agents(self, agents: u32) -> Range<u32> {
        let first =
            |rank: u32| (u64::from(rank) * u64::from(agents) / u64::from(self.count)) as u32;
        first(self.rank)..first(self.rank + 1)
    }

    /// The values of all ranks, in their order.
    #[must_use]
    pub(crate) fn all_gather<T: Serialize + DeserializeOwned>(self, value: T) -> Vec<T> {
        if self.is_single() {
            return vec![value];
        }
        measured(|| {
            let gathered = calls::all_gather(&to_bytes(&value));
            gathered.iter().map(|bytes| from_bytes(bytes)).collect()
        })
    }

    /// The values of all ranks, in their order, on rank 0; the value of the rank itself on others.
    #[must_use]
    pub(crate) fn gather<T: Serialize + DeserializeOwned>(self, value: T) -> Vec<T> {
        if self.is_single() {
            return vec![value];
        }
        let gathered = self.gather_bytes(to_bytes(&value));
        if self.is_first() {
            gathered.iter().map(|bytes| decode(bytes)).collect()
        } else {
            vec![value]
        }
    }

    /// The lists of all ranks, one after the other, on rank 0; the rank's own list on others.
    #[must_use]
    pub(crate) fn gather_lists<T: Serialize + DeserializeOwned>(self, list: Vec<T>) -> Vec<T> {
        self.gather(list).into_iter().flatten().collect()
    }

    /// The sums of the numbers of all ranks, on all ranks. Whole numbers have the same sum in any order.
    #[must_use]
    pub(crate) fn sum(self, numbers: Vec<u64>) -> Vec<u64> {
        if self.is_single() {
            return numbers;
        }
        measured(|| calls::sum(&numbers))
    }

    /// Passes lists of numbers along all ranks, in their order: to list `number`, which is empty on rank 0, each rank does
    /// `add`. So sums of numbers that are rounded have the bits of one process. Returns the lists on the last rank, `None`
    /// on others.
    #[must_use]
    pub(crate) fn pass_along(
        self,
        lists: usize,
        mut add: impl FnMut(usize, &mut Vec<f64>),
    ) -> Option<Vec<Vec<f64>>> {
        let is_last = self.rank + 1 == self.count;
        let mut kept = Vec::new();
        for number in 0..lists {
            let mut list = Vec::new();
            if self.rank > 0 {
                list = measured(|| calls::receive_numbers(self.rank - 1));
                RECEIVED_BYTES.fetch_add(8 * list.len() as u64, Ordering::Relaxed);
            }
            add(number, &mut list);
            if is_last {
                kept.push(list);
            } else {
                measured(|| calls::send_numbers(self.rank + 1, &list));
            }
        }
        is_last.then_some(kept)
    }

    /// The bytes of all ranks, in their order, on rank 0; the rank's own bytes on others.
    #[must_use]
    pub(crate) fn gather_bytes(self, bytes: Vec<u8>) -> Vec<Vec<u8>> {
        if self.is_single() {
            return vec![bytes];
        }
        measured(|| match calls::gather(&bytes) {
            Some(gathered) => {
                let received = gathered.iter().skip(1).map(Vec::len).sum::<usize>();
                RECEIVED_BYTES.fetch_add(received as u64, Ordering::Relaxed);
                gathered
            }
            None => vec![bytes],
        })
    }

    /// The value of rank 0, on all ranks.
    #[must_use]
    pub(crate) fn broadcast<T: Serialize + DeserializeOwned>(self, value: T) -> T {
        if self.is_single() {
            return value;
        }
        measured(|| {
            let bytes = self.is_first().then(|| to_bytes(&value));
            let received = calls::broadcast(bytes);
            received.map_or(value, |bytes| from_bytes(&bytes))
        })
    }

    /// Sends `values[r]` to rank r, for each rank; returns what each rank has sent to this one. There
    /// must be several ranks.
    #[must_use]
    pub(crate) fn exchange<T: Serialize + DeserializeOwned>(self, values: &[T]) -> Vec<T> {
        self.exchange_as(values)
    }

    /// Like [`exchange`](Self::exchange), with values that are borrowed where they are sent.
    #[must_use]
    pub(crate) fn exchange_as<S: Serialize, R: DeserializeOwned>(self, values: &[S]) -> Vec<R> {
        assert_eq!(values.len(), self.count as usize, "one value for each rank");
        measured(|| {
            let sent: Vec<Vec<u8>> = values.iter().map(to_bytes).collect();
            let received = calls::exchange(&sent);
            received.iter().map(|bytes| from_bytes(bytes)).collect()
        })
    }

    /// The result, if it is no error on any rank. Otherwise the first rank with an error returns it,
    /// and the others wait until that one ends all processes.
    ///
    /// # Errors
    /// The error of this rank, if no rank before it has one.
    pub fn agree<T, E>(self, result: Result<T, E>) -> Result<T, E> {
        if self.is_single() {
            return result;
        }
        let failed = self.all_gather(result.is_err());
        match failed.iter().position(|failed| *failed) {
            None => result,
            Some(first) if first == self.rank as usize => result,
            Some(_) => calls::wait_for_end(),
        }
    }
}

/// What a rank has exchanged with others.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Exchanged {
    /// Number of bytes that it has received.
    pub bytes: u64,
    /// Time in which it sent and received, seconds.
    pub seconds: f64,
    /// Time before that in which it waited for others, seconds.
    pub seconds_waited: f64,
}

static RECEIVED_BYTES: AtomicU64 = AtomicU64::new(0);
/// Time in exchanges, and the part of it in which this rank waited for others.
static NANOSECONDS: AtomicU64 = AtomicU64::new(0);
static NANOSECONDS_WAITED: AtomicU64 = AtomicU64::new(0);

/// What each rank has exchanged so far, on rank 0; that of the rank itself on others. All ranks must
/// call it.
#[must_use]
pub fn exchanged(ranks: Ranks) -> Vec<Exchanged> {
    let seconds = |total: &AtomicU64| total.load(Ordering::Relaxed) as f64 * 1e-9;
    let waited = seconds(&NANOSECONDS_WAITED);
    ranks.gather(Exchanged {
        bytes: RECEIVED_BYTES.load(Ordering::Relaxed),
        seconds: seconds(&NANOSECONDS) - waited,
        seconds_waited: waited,
    })
}

/// Adds the time of an exchange to what [`exchanged`] tells.
fn measured<R>(exchange: impl FnOnce() -> R) -> R {
    timed(&NANOSECONDS, exchange)
}

/// The same for the first call of an exchange, which all ranks make before they send anything long.
#[cfg(feature = "mpi")]
fn waiting<R>(call: impl FnOnce() -> R) -> R {
    timed(&NANOSECONDS_WAITED, call)
}

fn timed<R>(total: &AtomicU64, call: impl FnOnce() -> R) -> R {
    let start = Instant::now();
    let result = call();
    total.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
    result
}

/// # Panics
/// Never: plain data always serializes.
fn to_bytes<T: Serialize>(value: &T) -> Vec<u8> {
    postcard::to_stdvec(value).expect("plain data always serializes")
}

/// # Panics
/// If the bytes are not those of [`to_bytes`], as if the ranks were of different builds.
fn from_bytes<T: DeserializeOwned>(bytes: &[u8]) -> T {
    RECEIVED_BYTES.fetch_add(bytes.len() as u64, Ordering::Relaxed);
    decode(bytes)
}

/// # Panics
/// As [`from_bytes`].
fn decode<T: DeserializeOwned>(bytes: &[u8]) -> T {
    postcard::from_bytes(bytes).expect("all ranks run the same program")
}

#[cfg(feature = "mpi")]
use mpi_calls as calls;

/// What is never called in a build without MPI, which has a single process.
#[cfg(not(feature = "mpi"))]
mod calls {
    const REASON: &str = "a build without MPI has a single process";

    pub(super) fn all_gather(_: &[u8]) -> Vec<Vec<u8>> {
        unreachable!("{REASON}")
    }

    pub(super) fn gather(_: &[u8]) -> Option<Vec<Vec<u8>>> {
        unreachable!("{REASON}")
    }

    pub(super) fn broadcast(_: Option<Vec<u8>>) -> Option<Vec<u8>> {
        unreachable!("{REASON}")
    }

    pub(super) fn exchange(_: &[Vec<u8>]) -> Vec<Vec<u8>> {
        unreachable!("{REASON}")
    }

    pub(super) fn sum(_: &[u64]) -> Vec<u64> {
        unreachable!("{REASON}")
    }

    pub(super) fn receive_numbers(_: u32) -> Vec<f64> {
        unreachable!("{REASON}")
    }

    pub(super) fn send_numbers(_: u32, _: &[f64]) {
        unreachable!("{REASON}")
    }

    pub(super) fn wait_for_end() -> ! {
        unreachable!("{REASON}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The blocks of 10 agents on 3 ranks: ⌊10 r / 3⌋.
    #[test]
    fn blocks_are_consecutive_and_of_about_equal_size() {
        let blocks = [0, 1, 2].map(|rank| Ranks { rank, count: 3 }.local_agents(10));
        assert_eq!(blocks, [0..3, 3..6, 6..10]);
        assert_eq!(Ranks::SINGLE.local_agents(7), 0..7);
        let largest = Ranks {
            rank: 999,
            count: 1000,
        };
        assert_eq!(largest.local_agents(4_000_000), 3_996_000..4_000_000);
    }

    #[test]
    fn one_process_talks_to_itself() {
        let ranks = Ranks::SINGLE;
        assert_eq!(ranks.all_gather(3), [3]);
        assert_eq!(ranks.gather_lists(vec![3, 4]), [3, 4]);
        assert_eq!(ranks.sum(vec![3, 4]), [3, 4]);
        let passed = ranks.pass_along(2, |number, list| list.push(number as f64));
        assert_eq!(passed, Some(vec![vec![0.0], vec![1.0]]));
        assert_eq!(ranks.broadcast(5), 5);
        assert_eq!(ranks.agree::<(), _>(Err(7)), Err(7));
    }
}
