"""Reference values for the tests of seedbed-stats, computed by the packages that the field uses.

`reference.json` beside this file is its output, byte for byte; `tests/references.rs` reads it. To compute it again,
in a virtual environment of its own (three minutes):

    pip install rliable==1.2.0 numpy==2.4.6 scipy==1.17.1 lifelines==0.30.3 statsmodels==0.15.0
    python crates/seedbed-stats/tests/reference/reference.py
    git diff --exit-code crates/seedbed-stats/tests/reference/reference.json

Every input is in the JSON; those that are not written here are drawn from named streams, as multiples of 1/256. Nothing is
computed here that a package computes. Results are rounded to eleven digits.
"""

import json
import math
import random
from importlib.metadata import version
from pathlib import Path

import numpy as np
from lifelines import KaplanMeierFitter
from lifelines.utils import median_survival_times, restricted_mean_survival_time
from rliable import library, metrics
from scipy import stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import TTestIndPower, TTestPower
from statsmodels.stats.proportion import proportion_confint

RESAMPLES = 50_000
GOAL = 1.0


def main():
    packages = ("rliable", "numpy", "scipy", "lifelines", "statsmodels")
    reference = {
        "made_by": {package: version(package) for package in packages},
        "resamples": RESAMPLES,
        "goal": GOAL,
        "aggregates": [
            aggregate_case("one task", normals("one task", 7, 1)),
            aggregate_case("three tasks", normals("three tasks", 10, 3)),
            aggregate_case("four tasks", normals("four tasks", 23, 4)),
            aggregate_case("outliers", np.exp(normals("outliers", 12, 2) * 2)),
        ],
        "wins": [win_case("apart", 0.5, 10, 8), win_case("tied", 0.0, 12, 12)],
        "profile": profile_case(normals("profile", 20, 2), [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0]),
        "means": [means_case(5, 6, 0.0), means_case(7, 7, 2.5), means_case(30, 20, 0.6)],
        "differences": [differences_case(9, 0.3), differences_case(12, 0.5), differences_case(31, 0.5)],
        "mcnemar": [mcnemar_case(1, 5), mcnemar_case(0, 4), mcnemar_case(3, 9)],
        "shares": [shares_case(7, 10, 2, 12), shares_case(20, 20, 15, 20), shares_case(3, 30, 9, 30), shares_case(57, 60, 42, 60)],
        "single_shares": [single_share_case(0, 10), single_share_case(7, 10), single_share_case(30, 30)],
        "power": power_cases(),
        "holm": [holm_case([0.01, 0.04, 0.03, 0.005]), holm_case([0.6, 0.02, 0.02, 0.9, 0.011, 0.4]), holm_case([0.03])],
        "survival": survival_cases(),
        "restricted": [restricted_case(words, horizon) for words, horizon in RESTRICTED],
    }
    Path(__file__).with_name("reference.json").write_text(text(reference) + "\n", encoding="utf-8")


# Scores [run × task], as rliable has them; the JSON has [task][run].


def aggregate_case(name, scores):
    def all_four(scores):
        return np.array(
            [
                metrics.aggregate_mean(scores),
                metrics.aggregate_median(scores),
                metrics.aggregate_iqm(scores),
                metrics.aggregate_optimality_gap(scores, GOAL),
            ]
        )

    values, intervals = intervals_of(scores, all_four)
    kinds = ("mean", "median", "interquartile_mean", "optimality_gap")
    estimates = {kind: estimate(values[i], intervals[:, i]) for i, kind in enumerate(kinds)}
    return {"name": name, "scores": scores.T.tolist()} | estimates


def win_case(name, shift, n, m):
    x, y = normals(f"{name} x", n, 1)[:, 0] + shift, normals(f"{name} y", m, 1)[:, 0]
    if name == "tied":
        x, y = np.round(x), np.round(y)
    return {"x": x.tolist(), "y": y.tolist(), "probability": stats.mannwhitneyu(x, y).statistic / (n * m)}


def profile_case(scores, thresholds):
    np.random.seed(0)
    shares, bands = library.create_performance_profile({"x": scores}, np.array(thresholds), reps=RESAMPLES)
    points = [estimate(shares["x"][i], bands["x"][:, i]) for i in range(len(thresholds))]
    return {"scores": scores.T.tolist(), "thresholds": thresholds, "points": points}


def intervals_of(scores, statistic):
    np.random.seed(0)  # rliable draws from the global generator, whatever its argument random_state says
    values, intervals = library.get_interval_estimates({"x": scores}, statistic, reps=RESAMPLES)
    return values["x"], intervals["x"]


# One-sided tests; "exact" cases have few enough permutations for all of them.


def welch_t(x, y, axis):
    return stats.ttest_ind(x, y, equal_var=False, axis=axis).statistic


def means_case(n, m, shift):
    x, y = normals(f"means x {n}", n, 1)[:, 0] * 2 + shift, normals(f"means y {m}", m, 1)[:, 0]
    p = permutation_p_values((x, y), welch_t, "independent")
    return {"x": x.tolist(), "y": y.tolist(), "difference": np.mean(x) - np.mean(y)} | p


def differences_case(count, shift):
    differences = normals(f"differences {count}", count, 1)[:, 0] + shift
    return {"differences": differences.tolist()} | permutation_p_values((differences,), np.mean, "samples")


def permutation_p_values(data, statistic, kind):
    def p(alternative):
        generator = np.random.default_rng(0)
        return stats.permutation_test(
            data, statistic, permutation_type=kind, vectorized=True, n_resamples=99_999, alternative=alternative, rng=generator
        ).pvalue

    return {"p_above": p("greater"), "p_below": p("less")}


def mcnemar_case(negative, positive):
    p = mcnemar([[7, negative], [positive, 9]], exact=True).pvalue
    return {"negative": negative, "positive": positive, "two_sided": p}


def shares_case(first, n, second, m):
    table = [[first, second], [n - first, m - second]]
    p = [stats.barnard_exact(table, alternative, pooled=True, n=512).pvalue for alternative in ("greater", "less")]
    return {"first": [first, n], "second": [second, m], "p_above": p[0], "p_below": p[1]}


def single_share_case(successes, runs):
    low, high = proportion_confint(successes, runs, method="wilson")
    return {"successes": successes, "runs": runs, "low": low, "high": high}


def power_cases():
    cases = [(effect, level, power) for effect in (0.3, 0.8, 1.5) for level in (0.025, 0.0025) for power in (0.8, 0.9)]
    return [power_case(*case) for case in cases]


def power_case(effect, level, power):
    how = {"effect_size": effect, "alpha": level, "power": power, "alternative": "larger"}
    return {
        "effect": effect,
        "level": level,
        "power": power,
        "runs": math.ceil(TTestIndPower().solve_power(**how)),
        "pairs": math.ceil(TTestPower().solve_power(**how)),
    }


def holm_case(p):
    rejected, corrected, _, _ = multipletests(p, 0.05, method="holm")
    return {"p": p, "corrected": corrected.tolist(), "rejected": rejected.tolist()}


# Lifetimes; a "+" marks a run that ended before it reached the threshold.

GLIOMA_3 = "6 13 21 30 31+ 37 38 47+ 49 50 63 79 80+ 82+ 82+ 86 98 149+ 202 219"
GLIOMA_4 = "10 10 12 13 14 15 16 17 18 20 24 24 25 28 30 33 34+ 35 37 40 40 40+ 46 48 70+ 76 81 82 91 112 181"


def survival_cases():
    runs = {
        "glioma, grade 3": GLIOMA_3,
        "glioma, grade 4": GLIOMA_4,
        "all of five": "7 3 5 9 11",
        "all of ten": "80 95 101 110 127 128 140 151 160 183",
        "seven of ten": "299 410 512 600+ 480 333 600+ 345 600+ 391",
        "three of ten": "299 600+ 600+ 410 600+ 600+ 600+ 512 600+ 600+",
        "none of six": "200+ 200+ 200+ 200+ 200+ 200+",
        "ties": "5 5 5+ 6 6 6 7+ 8 8 8+ 9 9 10+ 10",
    }
    return [survival_case(name, words) for name, words in runs.items()]


def survival_case(name, words):
    times, reached = lifetimes(words)
    curve = stats.ecdf(censored(times, reached)).sf
    fitter = KaplanMeierFitter().fit(times, reached)
    band = fitter.confidence_interval_
    steps = []
    for time in np.unique(times[reached]):
        low, high = band.loc[time]
        steps.append({"time": time, "survival": float(curve.evaluate(time)), "low": low, "high": high})
    low, high = median_survival_times(band).iloc[0] if len(steps) else (math.inf, math.inf)
    return {
        "name": name,
        "times": times.tolist(),
        "reached": reached.tolist(),
        "steps": steps,
        "median": known(fitter.median_survival_time_),
        "median_low": known(low),
        "median_high": known(high),
    }


RESTRICTED = [
    ("80 95 101 110 127 128 140 151 160 183", 150.0),
    ("299 410 512 600+ 480 333 600+ 345 600+ 391", 600.0),
    ("5 5 6 6 7+ 8 7+", 7.0),
]


def restricted_case(words, horizon):
    times, reached = lifetimes(words)
    mean = restricted_mean_survival_time(KaplanMeierFitter().fit(times, reached), t=horizon)
    return {"times": times.tolist(), "reached": reached.tolist(), "horizon": horizon, "mean": mean}


def lifetimes(words):
    words = words.split()
    return np.array([float(word.rstrip("+")) for word in words]), np.array([not word.endswith("+") for word in words])


def censored(times, reached):
    return stats.CensoredData(uncensored=times[reached], right=times[~reached])


# Numbers in and out.


def normals(name, rows, columns):
    """[rows × columns] of standard normal numbers"""
    stream = random.Random(name)
    drawn = [[round(stream.gauss(0, 1) * 256) / 256 for _ in range(columns)] for _ in range(rows)]
    return np.array(drawn)


def estimate(value, ends):
    return {"value": float(value), "low": float(ends[0]), "high": float(ends[1])}


def known(number):
    return float(number) if math.isfinite(number) else None


def text(value, indent=0):
    """JSON with one number to eleven digits, and lists of numbers on one line."""
    if isinstance(value, dict):
        inner = ",\n".join(f'{" " * (indent + 1)}{json.dumps(key)}: {text(item, indent + 1)}' for key, item in value.items())
        return "{\n" + inner + "\n" + " " * indent + "}"
    if isinstance(value, list) and any(isinstance(item, (dict, list)) for item in value):
        inner = ",\n".join(" " * (indent + 1) + text(item, indent + 1) for item in value)
        return "[\n" + inner + "\n" + " " * indent + "]"
    if isinstance(value, list):
        return "[" + ", ".join(text(item) for item in value) + "]"
    if isinstance(value, (float, np.floating)):
        return repr(float(f"{value:.11g}"))
    return json.dumps(value, ensure_ascii=False)


if __name__ == "__main__":
    main()
