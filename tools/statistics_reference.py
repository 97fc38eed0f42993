"""Reference figures of the laboratory's statistics, from scipy and statsmodels or by counting.

    python -m venv venv && venv/bin/pip install scipy==1.17.1 statsmodels==0.15.0
    venv/bin/python tools/statistics_reference.py > crates/cfpose-lab/tests/data/statistics.json

Nothing here shares code with the project: the medians' intervals are counted over all n^n resamples (small n) or drawn a million
times by scipy (larger n), profiles are counted with loops.
"""

import itertools
import json
import math

import numpy as np
import scipy
import statsmodels
from scipy import stats
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.proportion import proportion_confint

rng = np.random.default_rng(20261126)
numbers = lambda values: [float(v) for v in values]


def wilcoxon_case(differences):
    d = np.asarray(differences, float)
    kept = d[d != 0]
    tied = len(set(abs(kept))) < len(kept)
    method = "exact" if len(kept) <= 50 and not tied else "approx"
    test = stats.wilcoxon(kept, method=method, correction=False)
    ranks = stats.rankdata(abs(kept))
    return {"differences": numbers(d), "p": float(test.pvalue), "method": method,
            "positive": float(ranks[kept > 0].sum()), "negative": float(ranks[kept < 0].sum())}


def enumerated_median(values):
    """All n^n resamples, each as likely; least value with at least that probability below or at it."""
    medians = sorted(float(np.median(r)) for r in itertools.product(values, repeat=len(values)))
    at = lambda q: medians[math.ceil(round(q * len(medians), 9)) - 1]
    return {"values": numbers(values), "median": float(np.median(values)), "interval": [at(0.025), at(0.975)]}


def drawn_median(values):
    draws = stats.bootstrap((values,), np.median, n_resamples=1_000_000, batch=20_000, method="percentile",
                            confidence_level=0.95, rng=np.random.default_rng(1))
    return {"values": numbers(values), "median": float(np.median(values)),
            "interval": numbers(draws.confidence_interval)}


def power_law(x, y):
    fit = stats.linregress(np.log(x), np.log(y))
    half = stats.t.ppf(0.975, len(x) - 2) * fit.stderr
    return {"x": numbers(x), "y": numbers(y), "exponent": float(fit.slope), "factor": float(math.exp(fit.intercept)),
            "interval": [float(fit.slope - half), float(fit.slope + half)]}


def profile(costs, multiples):
    """Dolan and More: rho_s(tau), counted problem by problem. null is a failure."""
    shares = []
    for solver in range(len(costs[0])):
        shares.append([sum(1 for p in costs if p[solver] is not None
                           and p[solver] <= tau * min(c for c in p if c is not None)) / len(costs) for tau in multiples])
    return {"costs": costs, "multiples": multiples, "shares": shares}


def data_profile(solved, budgets):
    return {"solved": solved, "budgets": budgets,
            "shares": [sum(1 for e, n in solved if e is not None and e <= b * (n + 1)) / len(solved) for b in budgets]}


# The maize data of Darwin (Fisher, The Design of Experiments, 1935, table 3): heights of crossed minus self-fertilised plants.
darwin = [6.125, -8.375, 1.0, 2.0, 0.75, 2.875, 3.5, 5.125, 1.75, 3.625, 7.0, 3.0, 9.375, 7.5, -6.0]
skewed = np.exp(rng.normal(size=101)).round(6)
costs = [[int(c) if rng.random() < 0.8 else None for c in rng.integers(5, 300, 3)] for _ in range(40)]
costs = [c for c in costs if any(v is not None for v in c)]
n_points = np.array([100, 316, 1000, 3162, 10000, 31623.0])
p_values = numbers((rng.random(12) ** 3).round(6))

print(json.dumps({
    "made_by": f"tools/statistics_reference.py, scipy {scipy.__version__}, statsmodels {statsmodels.__version__}",
    "wilson": [{"successes": s, "trials": n, "interval": numbers(proportion_confint(s, n, method="wilson"))}
               for s, n in [(0, 10), (3, 10), (81, 263), (999, 1000), (5, 5)]],
    "mcnemar": [{"only": [b, c], "p": float(mcnemar([[0, b], [c, 0]], exact=True).pvalue)}
                for b, c in [(2, 10), (10, 2), (0, 6), (59, 150), (7, 7), (400, 460)]],
    "holm": [{"p": p_values, "corrected": numbers(multipletests(p_values, method="holm")[1])}],
    "wilcoxon": [wilcoxon_case(d) for d in [
        darwin,
        rng.normal(0.4, 1, 12).round(4),
        rng.normal(0.2, 1, 50).round(6),
        rng.normal(0.2, 1, 200).round(6),
        rng.integers(-4, 7, 60),
        [1.5, 0, 0, -2.5, 3.5, 4.5, -0.5],
    ]],
    "median": [enumerated_median(v) for v in [
        [3.0, 1.0, 4.0, 1.5, 9.0], [2.0, 7.0, 1.0, 8.0, 2.5, 1.75], [5.0, 6.0], [0.5, 0.25, 2.0, 2.0, 2.0, 4.0, 8.0],
    ]] + [drawn_median(skewed)],
    "power_law": [power_law(n_points, 3e-6 * n_points**1.07 * np.exp(rng.normal(0, 0.1, 6))),
                  power_law(n_points[:3], np.array([1.0, 3.5, 11.0]))],
    "performance_profile": [profile(costs, [1, 1.5, 2, 4, 10, 100])],
    "data_profile": [data_profile([[c[0], int(n)] for c, n in zip(costs, rng.integers(2, 9, 40))], [1, 2, 5, 10, 50])],
}, indent=1))
