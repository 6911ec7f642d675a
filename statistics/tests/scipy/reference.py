"""Writes reference.json: samples, and the results of SciPy for them. tests/scipy.rs compares ours.

    python3 -m venv venv && venv/bin/pip install scipy statsmodels
    venv/bin/python statistics/tests/scipy/reference.py

The samples are drawn with a fixed seed, so another version of SciPy gives the same file except for
the versions in it, the last digits, and the bootstrap results within their spread. Holm's
correction and the log-rank test with strata, which SciPy lacks, are those of statsmodels.
"""

import json
import pathlib
import platform

import numpy
import scipy
import statsmodels
from scipy import stats
from statsmodels.duration.survfunc import survdiff
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


def exchanges():
    """The permutation test of paired means, and the effects that it does not reject, found by bisection."""

    def p_value(values):
        result = stats.permutation_test(
            (values, numpy.zeros(len(values))), lambda a, b, axis: numpy.mean(a, axis=axis) - numpy.mean(b, axis=axis),
            permutation_type="samples", n_resamples=numpy.inf, vectorized=True, axis=0,
        )
        return float(result.pvalue)

    def end(is_rejected, within, beyond):
        for _ in range(60):
            middle = (within + beyond) / 2
            within, beyond = (within, middle) if is_rejected(middle) else (middle, beyond)
        return (within + beyond) / 2

    def case(name, a, b, effect, has_interval=True):
        a, b = numpy.array(sample(a)), numpy.array(sample(b))
        estimate = float(a.mean() - b.mean() if effect == "difference" else a.mean() / b.mean())
        rejected = lambda to: p_value(a - b - to if effect == "difference" else a - to * b) <= 1 - LEVEL
        ends = None
        if has_interval:
            far = 10 * max(abs(a - b)) if effect == "difference" else 100.0
            ends = [end(rejected, estimate, estimate - far), end(rejected, estimate, estimate + far)]
        return {
            "name": name, "a": list(a), "b": list(b), "effect": effect, "estimate": estimate, "p_value": p_value(a - b),
            "ends": ends,
        }

    for pairs in (6, 8, 12):
        for shift in (0.0, 1.0):
            maps = RNG.normal(20, 5, pairs)
            a, b = maps + RNG.normal(shift, 1.5, pairs), maps + RNG.normal(0, 1.5, pairs)
            yield case(f"{pairs} pairs, shift {shift}", a, b, "difference")
            yield case(f"{pairs} pairs, shift {shift}", a, b, "ratio")
            # Differences of whole numbers have ties and zeros.
            a, b = RNG.integers(20, 26, pairs) + shift, RNG.integers(20, 26, pairs)
            yield case(f"{pairs} pairs of whole numbers, shift {shift}", a, b, "difference")
    for pairs in (2, 13, 16):
        a = RNG.exponential(10, pairs)
        yield case(f"{pairs} skewed pairs", a, RNG.exponential(14, pairs), "ratio", False)
    yield case("equal pairs", [3.0, 4.0, 5.0], [3.0, 4.0, 5.0], "difference", False)


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


def strata():
    """The log-rank test of statsmodels with each pair as a stratum, and the sign test of SciPy."""
    rng = numpy.random.default_rng(20261128)
    for pairs, factor, digits in ((6, 3, 3), (10, 1, 3), (25, 1.5, -2), (40, 1.3, 3)):
        maps = rng.exponential(600, pairs)
        times = [sample(numpy.minimum(maps * rng.exponential(scale, pairs), 1800), digits) for scale in (1, factor)]
        happened = [[time < 1800 for time in of] for of in times]
        chi_squared, _ = survdiff(
            numpy.concatenate(times), numpy.concatenate(happened).astype(int), numpy.repeat([0, 1], pairs),
            strata=numpy.tile(numpy.arange(pairs), 2),
        )
        first_a = sum(a < b for a, b in zip(*times))
        first = first_a + sum(b < a for a, b in zip(*times))
        yield {
            "a": times[0], "a_happened": happened[0], "b": times[1], "b_happened": happened[1],
            "chi_squared": float(chi_squared), "p_value": float(stats.binomtest(first_a, first).pvalue),
        }


def intervals():
    def mean(values, axis=-1):
        return numpy.mean(values, axis=axis)

    def ends(values):
        def interval(seed):
            result = stats.bootstrap(
                (values,), mean, n_resamples=RESAMPLES, confidence_level=LEVEL, method="BCa", vectorized=True,
                rng=numpy.random.default_rng(seed),
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
        yield {"name": name, "a": a, **ends(a)}


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
        "exchanges": list(exchanges()),
        "effect_sizes": list(effect_sizes()),
        "corrections": list(corrections()),
        "survivals": list(survivals()),
        "intervals": list(intervals()),
        "log_ranks": list(log_ranks()),
        "strata": list(strata()),
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
