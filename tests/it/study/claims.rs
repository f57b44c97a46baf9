//! Verdicts on claims.

use std::fs;
use std::path::Path;

use super::{run_study, study_text, write_study};
use crate::util::stdout;

/// The results of `σ 0` and `σ 0 again` are bit-identical: no claim of a difference may be supported.
/// A margin of 500 is wider than any return, one of 0.001 is narrower than six runs can show.
#[test]
fn a_claim_without_an_effect_is_not_supported() {
    let claim = |direction: &str, smallest: &str| {
        format!(
            r#"(text: "{direction} {smallest}", compare: ("σ 0 again", "σ 0"), direction: {direction}, smallest: {smallest}, because: "x", confirmatory: true)"#
        )
    };
    let claims = [
        ("More", "500"),
        ("Less", "0.001"),
        ("Same", "500"),
        ("Same", "0.001"),
        ("NotMore", "500"),
        ("NotLess", "500"),
    ];
    let claims = claims
        .map(|(direction, smallest)| claim(direction, smallest))
        .join(", ");
    let (_folder, study, out) = write_study(&study_text(6, &format!("claims: [{claims}],")));
    let printed = stdout(&run_study(&study, &out, &[]));
    for line in [
        "refuted              More 500",
        "open                 Less 0.001",
        "no relevant effect   Same 500",
        "open                 Same 0.001",
        "no relevant increase NotMore 500",
        "no relevant decrease NotLess 500",
        "6 confirmatory claims: 1 refuted, 2 open, 1 no relevant effect, 1 no relevant increase, 1 no relevant decrease",
    ] {
        assert!(printed.contains(line), "{line} in {printed}");
    }
    assert_no_effect_on_page(&out);
}

/// For each claim the page shows the probability that a run of the first cell has a return above, or
/// below, that of the second cell: 0.5.
fn assert_no_effect_on_page(out: &Path) {
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    let effect = ">Effect: difference between the means. Test: studentized permutation test.<";
    assert_eq!(page.matches(effect).count(), 6);
    let counts_of_sides = ["above", "below"].map(|side| {
        page.matches(&format!("; P(first {side} second) = 0.5 ("))
            .count()
    });
    assert_eq!(counts_of_sides, [2, 4]);
}

/// No run solves its task within eight episodes: all times are eight, which may be a ceiling, and
/// shows neither an effect nor that there is none.
#[test]
fn claims_about_unsolved_runs_are_open() {
    let claim = |direction: &str| {
        format!(
            r#"(text: "{direction}", compare: ("σ 9", "σ 0"), measure: EpisodesToSolve, direction: {direction}, smallest: 5, because: "x", confirmatory: true)"#
        )
    };
    let claims = ["More", "Less", "Same"].map(claim).join(", ");
    let (_folder, study, out) = write_study(&study_text(30, &format!("claims: [{claims}],")));
    let output = run_study(&study, &out, &[]);
    assert_eq!(stdout(&output).matches("\nopen ").count(), 3, "{output:?}");
    let table = fs::read_to_string(out.join("claims.md")).unwrap();
    assert!(
        table.contains(
            "| 0 (no interval: all runs have the same value), 8 against 8 | 30 | 1.0000 | open |"
        ),
        "{table}"
    );
    let page = fs::read_to_string(out.join("report.html")).unwrap();
    assert_eq!(
        page.matches("they may be at a floor or a ceiling").count(),
        3
    );
}

#[test]
fn a_claim_that_changed_after_its_runs_is_marked_as_late() {
    let claim = |size: u32| {
        format!(
            r#"claims: [(text: "x", compare: ("σ 9", "σ 0"), direction: Less, smallest: {size})],"#
        )
    };
    let is_late = |size: u32, out: &Path, study: &str| {
        fs::write(study, study_text(6, &claim(size))).unwrap();
        assert!(run_study(study, out, &[]).status.success());
        let page = fs::read_to_string(out.join("report.html")).unwrap();
        assert_eq!(
            page.contains(", claimed late</p>"),
            fs::read_to_string(out.join("claims.md"))
                .unwrap()
                .contains("claimed late")
        );
        page.contains(", claimed late</p>")
    };
    let (_folder, study, out) = write_study("");
    assert_eq!(
        [5, 5, 6, 6, 5].map(|size| is_late(size, &out, &study)),
        [false, false, true, true, true]
    );
}
