//! What the results show: intervals, verdicts, and runs that ended early.

use seedbed::study::evaluate::claims;
use seedbed::study::evaluate::results::Results;
use seedbed::study::store::StudyFolder;
use seedbed_stats::effect_test::{EffectTest, lower_bound, upper_bound};
use seedbed_stats::means::TwoMeans;
use seedbed_stats::shares::{Share, TwoShares};
use seedbed_stats::{Direction, Interval, Verdict, verdict_on_effect};

use super::Fixture;

/// Final returns of two cells, and whether they reach 5.
const FIRST: [f64; 6] = [3.0, 9.5, 4.0, 8.0, 7.25, 11.0];

const SECOND: [f64; 5] = [1.0, 2.5, 0.5, 5.5, 2.0];

/// Effects, intervals and verdicts are those of the tests of `seedbed-stats` on the same numbers: one
/// family of two claims of an effect, at 2.5 % on each side. The smaller p of the two is tested at
/// 0.025 / 2.
#[test]
fn intervals_and_verdicts_are_those_of_the_statistics() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Known numbers",
            solved: (return: 5, window: 1),
            cells: [(name: "first", results: Csv(files: "first/*.csv")), (name: "second", results: Csv(files: "second/*.csv"))],
            measures: [FinalReturn(window: 1)],
            claims: [
                (text: "more", compare: ("first", "second"), direction: More, smallest: 1, confirmatory: true),
                (text: "often", compare: ("first", "second"), measure: Solved, direction: More, smallest: 0.2),
            ],
        )"#,
    );
    for (cell, returns) in [("first", &FIRST[..]), ("second", &SECOND)] {
        for (number, value) in returns.iter().enumerate() {
            fixture.write(
                &format!("{cell}/{number}.csv"),
                &format!("return\n0\n{value}\n"),
            );
        }
    }
    fixture.succeed(&[]);
    let results = Results::read(&StudyFolder::new(fixture.path("out"))).unwrap();
    let found = claims::evaluate(&results);

    let test = TwoMeans::new(&FIRST, &SECOND);
    let interval = Interval::Known {
        low: lower_bound(&test, 0.025, 0.0),
        high: upper_bound(&test, 0.025, 1.0),
    };
    assert_eq!(found[0].interval, interval);
    assert_eq!(found[0].p, Some(test.p_above(0.0)));
    let verdict = verdict_on_effect(interval, Direction::Positive, 1.0);
    assert_eq!(
        (found[0].verdict, verdict),
        (Some(verdict), Verdict::Supported)
    );
    // 42.75 / 6 − 11.5 / 5 = 7.125 − 2.3.
    assert!((found[0].comparison.unwrap().effect.value - 4.825).abs() < 1e-6);

    // Four of six (9.5, 8, 7.25, 11) and one of five (5.5) reach 5.
    let share = |successes, runs| Share { successes, runs };
    let test = TwoShares::new(share(4, 6), share(1, 5));
    let Interval::Known { low, high } = found[1].interval else {
        panic!("{:?}", found[1].interval);
    };
    assert_eq!(found[1].comparison.unwrap().effect.value, test.estimate());
    assert!((test.p_above(low) - 0.025).abs() < 1e-3, "{low}");
    assert!((test.p_below(high) - 0.025).abs() < 1e-3, "{high}");
    assert_eq!(found[1].verdict, None);
}

/// A study of the cells `a` and `b` with confirmatory claims, and ten files of each with these returns.
fn study_of_cells(fields: &str, claims: &str, returns: [&dyn Fn(usize) -> Vec<f64>; 2]) -> Fixture {
    let cell = |name: &str| format!(r#"(name: "{name}", results: Csv(files: "{name}/*.csv"))"#);
    let fixture = Fixture::new(&format!(
        "Study(title: \"Cells\", {fields}, cells: [{}, {}], claims: [{claims}])",
        cell("a"),
        cell("b")
    ));
    for (cell, returns) in ["a", "b"].into_iter().zip(returns) {
        for run in 0..10 {
            // Files with equal returns must not be copies.
            let values = returns(run).into_iter();
            let rows = values.map(|value| format!("{value},{run}\n"));
            let text = format!("return,number\n{}", rows.collect::<String>());
            fixture.write(&format!("{cell}/{run}.csv"), &text);
        }
    }
    fixture
}

fn claim(text: &str, fields: &str) -> String {
    format!(r#"(text: "{text}", compare: ("a", "b"), {fields}, because: "x", confirmatory: true),"#)
}

/// 200 episodes, of which those from number `solved` on have the return 1.
fn solved_at(solved: usize) -> Vec<f64> {
    let mut returns = vec![0.0; 200];
    returns[solved - 1..].fill(1.0);
    returns
}

/// Both cells are solved after 60 to 87 episodes, but all files of `b` end after 30: nothing is known of
/// it up to episode 120, where it may be faster or slower. If only the last ten episodes before the horizon
/// are missing, they do not matter.
#[test]
fn runs_that_ended_early_say_nothing_of_what_came_later() {
    let times = "solved: (return: 1, window: 1), measures: [EpisodesToSolve]";
    let fields = "direction: Less, smallest: 5, horizon: 120";
    let claims = claim("a is faster", fields);
    let returns = |run: usize| solved_at(60 + 3 * run);
    let cut = |run: usize| returns(run)[..30].to_vec();
    let fixture = study_of_cells(times, &claims, [&returns, &cut]);
    let printed = fixture.succeed(&[]);
    let note = "Not known up to 120: 10 of 10 runs of b ended before without reaching their time, which may be any \
                after their end.";
    assert!(
        printed.contains("open             a is faster\n"),
        "{printed}"
    );
    assert!(printed.contains(note), "{printed}");
    for file in ["claims.md", "report.html"] {
        assert!(fixture.output(file).contains(note), "{file}");
    }
    // 73.5 on average, against times from 30 to 120.
    let table = fixture.output("claims.md");
    assert!(
        table.contains("−1.5 (") && table.contains(", 73.5 against 75 |"),
        "{table}"
    );

    let late = |_: usize| vec![0.0; 110];
    let fixture = study_of_cells(times, &claims, [&returns, &late]);
    let printed = fixture.succeed(&[]);
    assert!(
        printed.contains("supported        a is faster\n"),
        "{printed}"
    );
}

/// Without a horizon, times are compared up to the first end of a run that was not solved, here after seven
/// episodes, and the report says so.
#[test]
fn a_report_says_up_to_which_time_of_others_is_compared() {
    let times = "solved: (return: 1, window: 1), measures: [EpisodesToSolve]";
    let claims = r#"(text: "x", compare: ("a", "b"), direction: Less, smallest: 1)"#;
    let returns = |run: usize| solved_at(60 + 3 * run);
    let one_is_short = |run: usize| vec![0.0; if run == 4 { 7 } else { 200 }];
    let fixture = study_of_cells(times, claims, [&returns, &one_is_short]);
    let printed = fixture.succeed(&[]);
    let note =
        "Times are compared up to 7, where the first run ended that did not reach its time: ";
    assert!(printed.contains(note), "{printed}");
    for file in ["claims.md", "tables.md", "report.html"] {
        assert!(fixture.output(file).contains(note), "{file}");
    }
}

/// All returns are 0.1, but the means of 25 and of ten of them are rounded differently.
#[test]
fn rounding_is_no_effect() {
    let claims = ["More", "Less", "Same"].map(|direction| {
        claim(
            direction,
            &format!("direction: {direction}, smallest: 0.05"),
        )
    });
    let [many, few] = [25, 10].map(|episodes| move |_: usize| vec![0.1; episodes]);
    let fixture = study_of_cells(
        "measures: [FinalReturn()]",
        &claims.join(" "),
        [&many, &few],
    );
    let printed = fixture.succeed(&[]);
    assert!(
        printed.contains("3 confirmatory claims: 3 open"),
        "{printed}"
    );
    let table = fixture.output("claims.md");
    let found = "| 0 (no interval: all runs have the same value), 0.1 against 0.1 | 10 |";
    assert_eq!(table.matches(found).count(), 3, "{table}");
    assert_eq!(table.matches("| 1.0000 | open |").count(), 2, "{table}");
    assert!(!table.contains("Times are compared"), "{table}");
    assert!(
        fixture
            .output("tables.md")
            .contains("| 10 | 0 (no interval: all runs have the same value) | 0.5 (")
    );
}

/// One of three runs ended early without solving its task: it may have solved it afterwards. What did not solve its
/// task in all episodes is known.
#[test]
fn a_run_that_ended_early_may_have_solved_its_task() {
    let fixture = Fixture::new(
        r#"Study(
            title: "Early ends",
            solved: (return: 5, window: 1),
            max_episodes: 3,
            cells: [(name: "first", results: Csv(files: "first/*.csv")), (name: "second", results: Csv(files: "second/*.csv"))],
            measures: [Solved],
            claims: [(text: "often", compare: ("first", "second"), measure: Solved, direction: More, smallest: 0.2)],
        )"#,
    );
    for (name, returns) in [
        ("first/solved", "9"),
        ("first/early", "1\n2"),
        ("first/unsolved", "1\n2\n3"),
        ("second/solved", "1\n2\n8"),
        ("second/unsolved", "1\n2\n4\n9"),
    ] {
        fixture.write(&format!("{name}.csv"), &format!("return\n{returns}\n"));
    }
    fixture.succeed(&[]);
    let results = Results::read(&StudyFolder::new(fixture.path("out"))).unwrap();
    let comparison = claims::evaluate(&results)[0].comparison.unwrap();
    assert_eq!(
        (comparison.values, comparison.ended_early),
        ([0.5, 0.5], [1, 0])
    );
    let tables = fixture.output("tables.md");
    let note = "Not known of runs that ended before `max_episodes` without solving their task, which they may have solved \
                afterwards: 1 of 3 runs of first. Intervals hold for all that is possible, and shares are its middle.";
    assert!(tables.contains(note), "{tables}");
    assert!(
        tables.contains("| first | 3 | 0.5 (0.0615 to 0.939) |"),
        "{tables}"
    );
    assert!(fixture.output("claims.md").contains(note));
}
