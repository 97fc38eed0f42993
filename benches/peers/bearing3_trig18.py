"""The same computation in numpy and JAX: bearing3 x trig18, value and Jacobian, one thread. Run by hand, not in CI.

    python -m venv /tmp/peers && /tmp/peers/bin/pip install numpy jax
    cargo bench -p cfpose-benches --bench kernel --no-run
    /tmp/peers/bin/python benches/peers/bearing3_trig18.py target/release/deps/kernel-...

Runs the bench binary on the same points, checks that all three Jacobians agree, and prints times and ratios of this one run.
"""

import json
import os
import subprocess
import sys
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"
os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
os.environ["JAX_PLATFORMS"] = "cpu"
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)
PI = np.pi


def strip(count):
    """The points of the bench: a bent strip with a bump."""
    k = np.arange(count, dtype=float)
    u, v = k / count, np.modf(k * 0.618033988749895)[0]
    return np.stack([2 * u, v * (1 + 0.5 * u), 0.6 * u * u + 0.3 * np.sin(3 * v) * u])


def by_numpy(p, rotation, translation, mean, scale, coefficients):
    """Means of the features and their Jacobian along R exp([w]) and T, derivatives by hand."""
    y = rotation @ p + translation[:, None]
    inverse = 1 / np.sqrt((y * y).sum(0))
    unit = y * inverse
    x = (unit - mean[:, None]) * scale[:, None]
    s, c = np.sin(PI * x), np.cos(PI * x)
    value = np.stack([x, s, x * c, x * x, s * s, c], 1)
    slope = np.stack([np.ones_like(x), PI * c, c - PI * x * s, 2 * x, 2 * PI * s * c, -PI * s], 1)
    count = p.shape[1]
    zero = np.zeros(count)
    turned = [np.stack(t) for t in ((zero, -p[2], p[1]), (p[2], zero, -p[0]), (-p[1], p[0], zero))]
    dy = np.stack([rotation @ t for t in turned] + [np.repeat(np.eye(3)[:, j:j + 1], count, 1) for j in range(3)])
    # dx = scale (dy - unit (unit . dy)) / norm(y)
    dx = (dy - unit * (unit * dy).sum(1, keepdims=True)) * (inverse * scale[:, None])
    jacobian = np.einsum("qik,jqk->qij", slope, dx, optimize=True) / count
    return coefficients @ value.mean(2).ravel(), coefficients @ jacobian.reshape(18, 6)


def means_by_jax(step, p, rotation, translation, mean, scale, coefficients):
    """Means of the features after a step (w, t), to first order: R (I + [w]) p + T + t."""
    w, t = step[:3], step[3:]
    turned = p + jnp.stack([w[1] * p[2] - w[2] * p[1], w[2] * p[0] - w[0] * p[2], w[0] * p[1] - w[1] * p[0]])
    y = rotation @ turned + (translation + t)[:, None]
    x = (y / jnp.sqrt((y * y).sum(0)) - mean[:, None]) * scale[:, None]
    s, c = jnp.sin(PI * x), jnp.cos(PI * x)
    value = jnp.stack([x, s, x * c, x * x, s * s, c], 1)
    return coefficients @ value.mean(2).ravel()


def fastest(work, budget=3.0):
    """Seconds of the fastest call."""
    work()
    best, begun = np.inf, time.perf_counter()
    while time.perf_counter() - begun < budget:
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best


def main():
    bench = sys.argv[1:]
    if not bench:
        sys.exit("give the path of the bench binary: cargo bench -p cfpose-benches --bench kernel --no-run prints it")
    lines = subprocess.run(bench + ["peers"], check=True, capture_output=True, text=True).stdout.splitlines()
    for case in map(json.loads, lines):
        count, theta = case["count"], np.array(case["theta"])
        matrix = np.array(case["matrix"])
        args = (theta[:9].reshape(3, 3), theta[9:], np.array(case["mean"]), np.diag(matrix).copy(),
                np.array(case["coefficients"]).reshape(-1, 18))
        exact = np.array(case["jacobian"]).reshape(-1, 6)
        p = strip(count)
        device = [jnp.array(a) for a in (p, *args)]
        both = jax.jit(lambda step, *rest: (means_by_jax(step, *rest), jax.jacfwd(means_by_jax)(step, *rest)))
        step = jnp.zeros(6)
        for name, jacobian in (("numpy", by_numpy(p, *args)[1]), ("jax", np.array(both(step, *device)[1]))):
            worst = np.abs(jacobian - exact).max()
            assert worst < 1e-9, f"{name} computes something else: {worst}"
        numpy_ns = fastest(lambda: by_numpy(p, *args)) * 1e9 / count
        jax_ns = fastest(lambda: jax.block_until_ready(both(step, *device))) * 1e9 / count
        print(f"N = {count}: numpy {numpy_ns:.0f}, JAX {jax_ns:.0f} ns per point")
        for isa, ns in case["ns_per_point"].items():
            print(f"  {isa:>9}: {ns:7.1f} ns per point, numpy x {numpy_ns / ns:.0f}, JAX x {jax_ns / ns:.0f}")


if __name__ == "__main__":
    main()
