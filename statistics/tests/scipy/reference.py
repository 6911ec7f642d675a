"""Writes reference.json: samples, and the results of SciPy for them. tests/scipy.rs compares ours.

    python3 -m venv venv && venv/bin/pip install scipy statsmodels
    venv/bin/python experiments/tests/scipy/reference.py

The samples are drawn with a fixed seed, so another version of SciPy gives the same file except for
the versions in it, the last digits, and the bootstrap results within their spread. Holm's
correction, which SciPy lacks, is that of statsmodels.
"""

import json
import pathlib
import platform

import numpy
import scipy
import statsmodels
from scipy import stats
from statsmodels.stats.multitest import multipletests

RNG = numpy.random.default_rng(20261121)
LEVEL = 0.95
RESAMPLES = 10_000
# Number of intervals, each with its own seed, for the spread of their ends.
REPETITIONS = 40


def sample(values, digits=3):
    """Few digits keep the file short and its numbers exact."""
    return [round(float(value), digits) for value in values]


def quantiles():
    for values in ([4.2], [1.0, 2.0], RNG.normal(0, 5, 10), RNG.exponential(100, 31), RNG.integers(0, 4, 12)):
        values = sorted(sample(values))
        for share in (0.0, 0.01, 0.25, 0.5, 0.75, 0.9, 1.0):
            yield {"values": values, "share": share, "quantile": float(numpy.quantile(values, share))}


def areas():
    for count, end, horizon in ((5, 100, 100), (20, 80, 100), (20, 150, 100), (1, 30, 100), (7, 10, 60)):
        times = sorted(set(sample(RNG.uniform(0, end, count))))
        heights = sorted(sample(RNG.uniform(0, 1, len(times))))
        corners = numpy.array(sorted({0.0, float(horizon), *(time for time in times if time < horizon)}))
        area = numpy.trapezoid(numpy.interp(corners, times, heights), corners) / horizon
        yield {"points": list(zip(times, heights)), "horizon": float(horizon), "area": float(area)}


def signed_ranks():
    def case(name, a, b):
        a, b = sample(a), sample(b)
        result = stats.wilcoxon(a, b)
        pairs = int(numpy.count_nonzero(numpy.subtract(a, b)))
        statistic, p_value = float(result.statistic), float(result.pvalue)
        return {"name": name, "a": a, "b": b, "statistic": statistic, "p_value": p_value, "pairs": pairs}

    yield case("one pair", [2.0], [1.0])
    for pairs in (2, 5, 6, 10, 13, 14, 30, 50, 51, 100):
        for shift in (0.0, 0.5, 3.0):
            a = RNG.normal(10, 2, pairs)
            yield case(f"{pairs} pairs, no ties, shift {shift}", a, a + RNG.normal(shift, 1.5, pairs))
    for pairs in (4, 8, 13, 14, 20, 50, 60):
        for shift in (0, 1):
            a = RNG.integers(20, 30, pairs)
            # Differences of whole numbers have ties and zeros.
            yield case(f"{pairs} pairs, ties and zeros, shift {shift}", a, a + RNG.integers(-4, 5, pairs) + shift)
            # No zeros.
            steps = RNG.integers(1, 5, pairs) * RNG.choice([-1, 1, 1], pairs)
            yield case(f"{pairs} pairs, ties, shift {shift}", a, a + steps * (1 + shift))
    a = RNG.normal(10, 2, 12)
    zero = a.copy()
    zero[:9] += RNG.normal(1, 1, 9)
    yield case("12 pairs, three zeros, no ties", a, zero)
    yield case("12 pairs, all zero", a, a)


def effect_sizes():
    for left, right, shift in ((1, 1, 0), (10, 10, 1), (7, 12, 0), (30, 30, 3)):
        for name, draw in (("normal", lambda n: RNG.normal(0, 2, n)), ("whole", lambda n: RNG.integers(0, 5, n))):
            a, b = sample(draw(left) + shift), sample(draw(right))
            u = stats.mannwhitneyu(a, b).statistic
            yield {"name": name, "a": a, "b": b, "a12": float(u) / (left * right)}


def corrections():
    for p_values in ([0.04], [0.01, 0.04, 0.03], [0.5, 0.9, 0.7], [0.02] * 4, RNG.uniform(0, 0.1, 12), [0.0, 1.0, 0.3]):
        p_values = sample(p_values, 5)
        yield {"p_values": p_values, "adjusted": multipletests(p_values, method="holm")[1].tolist()}


def survivals():
    def case(name, times, happened, horizon):
        times = sample(times)
        happened = [bool(did) for did in happened]
        right_censored = stats.CensoredData.right_censored(times, [not did for did in happened])
        survival = stats.ecdf(right_censored).sf
        steps = [(0.0, 1.0)]
        for time in sorted({time for time, did in zip(times, happened) if did}):
            steps.append((time, float(survival.evaluate(time))))
        at_or_below = [time for time, share in steps if share <= 0.5 + 1e-9]
        corners = [time for time, _ in steps if time < horizon] + [horizon]
        restricted = sum((to - start) * float(survival.evaluate(start)) for start, to in zip(corners, corners[1:]))
        return {
            "name": name,
            "times": times,
            "happened": happened,
            "horizon": float(horizon),
            "steps": steps,
            "median": at_or_below[0] if at_or_below else None,
            "restricted_mean": restricted,
            "success_fraction": sum(happened) / len(happened),
        }

    yield case("all reached", RNG.exponential(300, 10), [True] * 10, 1800)
    yield case("none reached", [1800] * 5, [False] * 5, 1800)
    watched = numpy.minimum(RNG.exponential(1500, 30), 1800)
    yield case("watched to the horizon", watched, watched < 1800, 1800)
    watched = numpy.minimum(RNG.exponential(4000, 11), 1800)
    yield case("most not reached", watched, watched < 1800, 1800)
    for runs in (5, 12, 40):
        yield case(f"{runs} runs lost on the way", RNG.uniform(100, 1700, runs), RNG.random(runs) < 0.6, 1800)
    yield case("ties", RNG.integers(1, 8, 25) * 100, RNG.random(25) < 0.7, 800)
    yield case("horizon among the times", RNG.uniform(100, 1700, 20), RNG.random(20) < 0.8, 900)


def log_ranks():
    """Samples of their own stream, so that the other ones stay as they are."""
    rng = numpy.random.default_rng(20261122)
    for left, right, factor, digits in ((1, 1, 1, 3), (6, 6, 2, 3), (10, 10, 1, 3), (30, 30, 1.3, 3), (12, 20, 2, -2)):
        samples = []
        for runs, scale in ((left, 900), (right, 900 * factor)):
            times = sample(numpy.minimum(rng.exponential(scale, runs), 1800), digits)
            samples.append((times, [time < 1800 for time in times]))
        censored = [
            stats.CensoredData.right_censored(times, [not did for did in happened]) for times, happened in samples
        ]
        (a, a_happened), (b, b_happened) = samples
        z = float(stats.logrank(*censored).statistic)
        yield {"a": a, "a_happened": a_happened, "b": b, "b_happened": b_happened, "z": z}


def intervals():
    def mean(values, axis=-1):
        return numpy.mean(values, axis=axis)

    def ratio(a, b, axis=-1):
        return numpy.mean(a, axis=axis) / numpy.mean(b, axis=axis)

    def ends(samples, statistic, paired):
        def interval(seed):
            result = stats.bootstrap(
                samples, statistic, n_resamples=RESAMPLES, confidence_level=LEVEL, method="BCa", paired=paired,
                vectorized=True, rng=numpy.random.default_rng(seed),
            )
            return result.confidence_interval

        found = [interval(seed) for seed in range(REPETITIONS)]
        low, high = ([float(getattr(one, end)) for one in found] for end in ("low", "high"))
        return {
            "low": numpy.mean(low), "low_spread": numpy.std(low, ddof=1),
            "high": numpy.mean(high), "high_spread": numpy.std(high, ddof=1),
        }

    for name, values in (
        ("5 normal", RNG.normal(100, 15, 5)),
        ("10 normal", RNG.normal(100, 15, 10)),
        ("30 normal", RNG.normal(0, 1, 30)),
        ("10 skewed", RNG.exponential(50, 10)),
        ("30 skewed", RNG.lognormal(3, 1, 30)),
        ("20 shares", RNG.beta(8, 1, 20)),
        ("12 whole", RNG.integers(0, 4, 12)),
    ):
        a = sample(values)
        yield {"name": name, "kind": "mean", "a": a, **ends((a,), mean, False)}
    for runs in (10, 30):
        maps = RNG.normal(600, 150, runs)
        a, b = sample(maps * 1.2 + RNG.normal(0, 30, runs)), sample(maps + RNG.normal(0, 30, runs))
        yield {"name": f"{runs} pairs", "kind": "paired", "a": a, "b": b, **ends((a, b), ratio, True)}
        yield {"name": f"{runs} apart", "kind": "independent", "a": a, "b": b, **ends((a, b), ratio, False)}
    a, b = sample(RNG.exponential(50, 12)), sample(RNG.exponential(30, 20))
    yield {"name": "12 and 20 skewed", "kind": "independent", "a": a, "b": b, **ends((a, b), ratio, False)}


def main():
    reference = {
        "versions": {
            "python": platform.python_version(),
            "numpy": numpy.__version__,
            "scipy": scipy.__version__,
            "statsmodels": statsmodels.__version__,
        },
        "level": LEVEL,
        "resamples": RESAMPLES,
        "quantiles": list(quantiles()),
        "areas": list(areas()),
        "signed_ranks": list(signed_ranks()),
        "effect_sizes": list(effect_sizes()),
        "corrections": list(corrections()),
        "survivals": list(survivals()),
        "intervals": list(intervals()),
        "log_ranks": list(log_ranks()),
    }
    # One line per case, for readable diffs.
    lines = []
    for key, value in reference.items():
        if isinstance(value, list):
            cases = ",\n".join("  " + json.dumps(case) for case in value)
            lines.append(f"{json.dumps(key)}: [\n{cases}\n ]")
        else:
            lines.append(f"{json.dumps(key)}: {json.dumps(value)}")
    text = "{\n " + ",\n ".join(lines) + "\n}\n"
    json.loads(text)
    pathlib.Path(__file__).with_name("reference.json").write_text(text)


if __name__ == "__main__":
    main()
