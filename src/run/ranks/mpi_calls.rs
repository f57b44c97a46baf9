//! Calls of MPI on bytes. Lists of bytes have any length: MPI counts elements in 32 bits, so long ones
//! are sent in pieces.

use mpi::Threading;
use mpi::collective::{CommunicatorCollectives, SystemOperation};
use mpi::environment::Universe;
use mpi::point_to_point::{Destination, Source};
use mpi::request::{WaitGuard, scope};
use mpi::topology::{Communicator, SimpleCommunicator};
use mpi::traits::Root;

use super::{Ranks, waiting};

/// Largest number of bytes in one message.
const MAX_PIECE: usize = 1 << 30;

/// A process of an MPI job. Leaves MPI when it is dropped, which waits for the other ranks.
pub struct Process {
    /// This process and the others.
    pub ranks: Ranks,
    _universe: Universe,
}

/// Enters MPI, for calls from this thread only. `None` if this process has been in MPI before.
#[must_use]
pub fn enter() -> Option<Process> {
    let (universe, _) = mpi::initialize_with_threading(Threading::Funneled)?;
    let world = universe.world();
    Some(Process {
        ranks: Ranks {
            rank: world.rank() as u32,
            count: world.size() as u32,
        },
        _universe: universe,
    })
}

/// Ends all processes of the job with this exit code.
pub fn abort(exit_code: i32) -> ! {
    world().abort(exit_code)
}

fn world() -> SimpleCommunicator {
    SimpleCommunicator::world()
}

/// Waits until another rank [ends](abort) this process.
pub(super) fn wait_for_end() -> ! {
    loop {
        std::thread::park();
    }
}

/// The lists of all ranks.
pub(super) fn all_gather(bytes: &[u8]) -> Vec<Vec<u8>> {
    let lengths = all_lengths(bytes);
    if lengths.iter().sum::<usize>() <= MAX_PIECE {
        return all_gather_at_once(bytes, &lengths);
    }
    let mut lists: Vec<Vec<u8>> = lengths.into_iter().map(|length| vec![0; length]).collect();
    lists[world().rank() as usize].copy_from_slice(bytes);
    for (root, list) in lists.iter_mut().enumerate() {
        broadcast_pieces(root, list);
    }
    lists
}

/// The lists of all ranks, which together are short enough for one call.
fn all_gather_at_once(bytes: &[u8], lengths: &[usize]) -> Vec<Vec<u8>> {
    let counts: Vec<i32> = lengths.iter().map(|&length| length as i32).collect();
    let starts: Vec<i32> = counts
        .iter()
        .scan(0, |end, count| {
            let start = *end;
            *end += count;
            Some(start)
        })
        .collect();
    let mut all = vec![0_u8; lengths.iter().sum()];
    let mut partition = mpi::datatype::PartitionMut::new(&mut all[..], counts, starts);
    world().all_gather_varcount_into(bytes, &mut partition);
    let mut rest = &all[..];
    let mut lists = Vec::new();
    for &length in lengths {
        let (list, after) = rest.split_at(length);
        lists.push(list.to_vec());
        rest = after;
    }
    lists
}

/// The lists of all ranks on rank 0, `None` on the others.
pub(super) fn gather(bytes: &[u8]) -> Option<Vec<Vec<u8>>> {
    let lengths = all_lengths(bytes);
    if world().rank() != 0 {
        for piece in bytes.chunks(MAX_PIECE) {
            world().process_at_rank(0).send(piece);
        }
        return None;
    }
    let mut lists = vec![bytes.to_vec()];
    for (rank, length) in lengths.into_iter().enumerate().skip(1) {
        let mut list = vec![0; length];
        receive_pieces(rank, &mut list);
        lists.push(list);
    }
    Some(lists)
}

/// The list of rank 0, `None` on rank 0 itself.
pub(super) fn broadcast(bytes: Option<Vec<u8>>) -> Option<Vec<u8>> {
    let mut length = bytes.as_ref().map_or(0, Vec::len) as u64;
    waiting(|| world().process_at_rank(0).broadcast_into(&mut length));
    let is_root = bytes.is_some();
    let mut list = bytes.unwrap_or_else(|| vec![0; length as usize]);
    broadcast_pieces(0, &mut list);
    (!is_root).then_some(list)
}

/// The sums of the numbers of all ranks.
pub(super) fn sum(numbers: &[u64]) -> Vec<u64> {
    let mut sums = vec![0; numbers.len()];
    waiting(|| world().all_reduce_into(numbers, &mut sums[..], SystemOperation::sum()));
    sums
}

/// The numbers that another rank sends to this one.
pub(super) fn receive_numbers(rank: u32) -> Vec<f64> {
    waiting(|| world().process_at_rank(rank as i32).receive_vec().0)
}

/// Sends numbers to another rank.
pub(super) fn send_numbers(rank: u32, numbers: &[f64]) {
    world().process_at_rank(rank as i32).send(numbers);
}

/// Sends one list to each rank; returns the lists that this rank was sent. In step s, each rank sends
/// to the one s after it and receives from the one s before it.
pub(super) fn exchange(sent: &[Vec<u8>]) -> Vec<Vec<u8>> {
    let world = world();
    let (rank, count) = (world.rank() as usize, sent.len());
    let lengths_sent: Vec<u64> = sent.iter().map(|list| list.len() as u64).collect();
    let mut lengths = vec![0_u64; count];
    waiting(|| world.all_to_all_into(&lengths_sent[..], &mut lengths[..]));
    let mut received: Vec<Vec<u8>> = vec![Vec::new(); count];
    received[rank].clone_from(&sent[rank]);
    for step in 1..count {
        let (to, from) = ((rank + step) % count, (rank + count - step) % count);
        received[from].resize(lengths[from] as usize, 0);
        scope(|scope| {
            let destination = world.process_at_rank(to as i32);
            let guards: Vec<WaitGuard<'_, _, _>> = sent[to]
                .chunks(MAX_PIECE)
                .map(|piece| WaitGuard::from(destination.immediate_send(scope, piece)))
                .collect();
            receive_pieces(from, &mut received[from]);
            drop(guards);
        });
    }
    received
}

fn all_lengths(bytes: &[u8]) -> Vec<usize> {
    let mut lengths = vec![0_u64; world().size() as usize];
    waiting(|| world().all_gather_into(&(bytes.len() as u64), &mut lengths[..]));
    lengths.into_iter().map(|length| length as usize).collect()
}

fn broadcast_pieces(root: usize, list: &mut [u8]) {
    for piece in list.chunks_mut(MAX_PIECE) {
        world().process_at_rank(root as i32).broadcast_into(piece);
    }
}

fn receive_pieces(from: usize, list: &mut [u8]) {
    for piece in list.chunks_mut(MAX_PIECE) {
        world().process_at_rank(from as i32).receive_into(piece);
    }
}
