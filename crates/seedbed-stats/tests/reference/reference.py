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
from lifelines.statistics import logrank_test
from lifelines.utils import median_survival_times
from rliable import library, metrics
from scipy import stats
from statsmodels.stats.multitest import multipletests

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
        "improvements": [
            improvement_case("apart", normals("x", 10, 2) + 0.5, normals("y", 8, 2)),
            improvement_case("tied", np.round(normals("tied x", 12, 3)), np.round(normals("tied y", 12, 3))),
        ],
        "profile": profile_case(normals("profile", 20, 2), [-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0]),
        "paired": [paired_case("short", 9, 0.3), paired_case("long", 31, 0.5)],
        "signed_ranks": signed_rank_cases(),
        "welch": [welch_case(5, 9, 0.0), welch_case(20, 12, 0.4), welch_case(30, 30, 2.0)],
        "holm": [holm_case([0.01, 0.04, 0.03, 0.005]), holm_case([0.6, 0.02, 0.02, 0.9, 0.011, 0.4]), holm_case([0.03])],
        "survival": survival_cases(),
        "log_rank": log_rank_cases(),
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


def improvement_case(name, x, y):
    value, interval = intervals_of([x, y], lambda x, y: np.array([metrics.probability_of_improvement(x, y)]))
    return {"name": name, "x": x.T.tolist(), "y": y.T.tolist(), "probability": estimate(value[0], interval[:, 0])}


def profile_case(scores, thresholds):
    np.random.seed(0)
    shares, bands = library.create_performance_profile({"x": scores}, np.array(thresholds), reps=RESAMPLES)
    points = [estimate(shares["x"][i], bands["x"][:, i]) for i in range(len(thresholds))]
    return {"scores": scores.T.tolist(), "thresholds": thresholds, "points": points}


def intervals_of(scores, statistic):
    np.random.seed(0)  # rliable draws from the global generator, whatever its argument random_state says
    values, intervals = library.get_interval_estimates({"x": scores}, statistic, reps=RESAMPLES)
    return values["x"], intervals["x"]


def paired_case(name, count, shift):
    x, y = normals(f"paired x {name}", count, 1)[:, 0] + shift, normals(f"paired y {name}", count, 1)[:, 0]
    case = {"name": name, "x": x.tolist(), "y": y.tolist()}
    for kind, statistic in (("mean", np.mean), ("median", np.median)):
        generator = np.random.default_rng(0)
        drawn = stats.bootstrap((x - y,), statistic, n_resamples=RESAMPLES, method="percentile", rng=generator)
        case[kind] = estimate(statistic(x - y), drawn.confidence_interval)
    return case


def signed_rank_cases():
    whole = np.round(normals("whole", 60, 1)[:, 0] * 3 + 1)
    apart = normals("apart", 80, 1)[:, 0] + np.arange(80) / 2**20 + 0.2  # so that no two magnitudes are equal
    all_signs = stats.PermutationMethod(n_resamples=2**17)
    return [
        signed_rank_case("exact, 6", apart[:6]),
        signed_rank_case("exact, 25", apart[:25]),
        signed_rank_case("exact, 50", apart[:50]),
        signed_rank_case("normal, 80", apart),
        signed_rank_case("ties, 12", whole[:12]),
        signed_rank_case("ties, 16", whole[:16], method=all_signs),
        signed_rank_case("ties, normal", np.concatenate([whole, whole[:20] + 1])),
    ]


def signed_rank_case(name, differences, **how):
    test = stats.wilcoxon(differences, **how)
    return {"name": name, "differences": differences.tolist(), "statistic": test.statistic, "p": test.pvalue}


def welch_case(n, m, shift):
    x, y = normals(f"welch x {n}", n, 1)[:, 0] * 2 + shift, normals(f"welch y {m}", m, 1)[:, 0]
    test = stats.ttest_ind(x, y, equal_var=False)
    return {"x": x.tolist(), "y": y.tolist(), "t": test.statistic, "degrees": test.df, "p": test.pvalue}


def holm_case(p):
    return {"p": p, "corrected": multipletests(p, method="holm")[1].tolist()}


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


def log_rank_cases():
    pairs = [
        (GLIOMA_3, GLIOMA_4),
        ("1 3 5 7 9+", "2 4 6 8 10 12+"),
        ("80 95 101 110 127 127 140", "299 410 512 600+ 480 600+ 345"),
        ("5 5 6 6 7+ 8", "5 6 6+ 7 7 9 9+"),
    ]
    return [log_rank_case(x, y) for x, y in pairs]


def log_rank_case(x, y):
    (x_times, x_reached), (y_times, y_reached) = lifetimes(x), lifetimes(y)
    test = stats.logrank(censored(x_times, x_reached), censored(y_times, y_reached))
    other = logrank_test(x_times, y_times, x_reached, y_reached)
    assert math.isclose(test.statistic**2, other.test_statistic, rel_tol=1e-9)
    return {
        "x": {"times": x_times.tolist(), "reached": x_reached.tolist()},
        "y": {"times": y_times.tolist(), "reached": y_reached.tolist()},
        "z": test.statistic,
        "p": test.pvalue,
    }


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
