//! Cost of recordings: time to create a recording, and states per second when a recording with 50
//! rounds of four agents is written.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use seedbed::record::rerun::RerunRecorder;
use seedbed::run::recorder::Recorder;
use seedbed::scenario::recording::RecordingSettings;

#[allow(
    clippy::struct_field_names,
    reason = "the rows of a round have the names of `RoundRecord`"
)]
#[path = "../tests/it/recording/synthetic_run.rs"]
mod synthetic_run;

use synthetic_run::SyntheticRun;

criterion_group!(benches, recording);
criterion_main!(benches);

fn recording(criterion: &mut Criterion) {
    let run = SyntheticRun::new(4, 50);
    let episodes = run.rounds.iter().flat_map(|round| &round.episodes);
    let states: usize = episodes.map(|episode| episode.length() + 1).sum();
    let folder = tempfile::tempdir().expect("a temporary folder can be created");
    let path = folder.path().join("run.rrd");
    let mut group = criterion.benchmark_group("recording");
    group.sample_size(10);
    group.bench_function("created", |bencher| {
        bencher
            .iter(|| RerunRecorder::create(&path, &run.run_info(), &RecordingSettings::default()));
    });
    group.throughput(Throughput::Elements(states as u64));
    group.bench_function("50 rounds of 4 agents", |bencher| {
        bencher.iter(|| {
            let settings = RecordingSettings::default();
            let mut recorder = RerunRecorder::create(&path, &run.run_info(), &settings)
                .expect("the temporary folder can be written");
            for round in &run.rounds {
                round.record(&mut recorder);
            }
            recorder
                .finish()
                .expect("the temporary folder can be written");
        });
    });
    group.finish();
}
