"""Public implementations of published models, with the hyperparameters they found; a program.

    python published_peers.py JOBS.npz ANSWERS.npz

Jobs hold x_low, y_low, x_high, y_high, x_test per key. It runs in the interpreter that has the
extra `peers`; it imports nothing of this project.
"""

import sys
import warnings

import numpy as np

RESTARTS = 10
SAMPLES = 2000  # of emukit's Monte Carlo through the low level; its own default is 100
VARIANCE = 1e-6  # of the noise of both levels


def log_rbf(kernel):
    """Log length scales of a GPy RBF kernel."""
    return np.log(np.atleast_1d(kernel.lengthscale.values))


def emukit_nargp(x_low, y_low, x_high, y_high, x_test):
    """Mean, sd, log-likelihoods and logs of the hyperparameters of both levels."""
    import GPy
    from emukit.multi_fidelity.convert_lists_to_array import (
        convert_x_list_to_array,
        convert_xy_lists_to_arrays,
    )
    from emukit.multi_fidelity.models.non_linear_multi_fidelity_model import (
        NonLinearMultiFidelityModel,
        make_non_linear_kernels,
    )

    d = x_low.shape[1]
    x, y = convert_xy_lists_to_arrays([x_low, x_high], [y_low[:, None], y_high[:, None]])
    model = NonLinearMultiFidelityModel(
        x, y, 2, make_non_linear_kernels(GPy.kern.RBF, 2, d, ARD=True), n_samples=SAMPLES,
        optimization_restarts=RESTARTS,
    )  # fmt: skip
    for each in model.models:
        each.Gaussian_noise.variance.fix(VARIANCE)
    model.optimize()
    tests = convert_x_list_to_array([x_test, x_test])[len(x_test) :]
    mean, variance = model.predict(tests)
    first, second = (each.kern for each in model.models)
    product, own = second.parts
    pose, below = product.parts
    noise = 0.5 * np.log(VARIANCE)
    return {
        "mean": mean[:, 0],
        "sd": np.sqrt(np.maximum(variance[:, 0], 0)),
        "log_likelihood": np.array([each.log_likelihood() for each in model.models]).ravel(),
        "theta_low": np.r_[0.5 * np.log(float(first.variance[0])), noise, log_rbf(first)],
        "theta_high": np.r_[
            0.5 * np.log(float(pose.variance[0]) * float(below.variance[0])), noise,
            log_rbf(pose), log_rbf(below),
            0.5 * np.log(float(own.variance[0])), log_rbf(own),
        ],
    }  # fmt: skip


def main(jobs_file, answers_file):
    warnings.simplefilter("ignore")
    jobs = np.load(jobs_file)
    answers = {}
    parts = ("x_low", "y_low", "x_high", "y_high", "x_test")
    for key in sorted({name.rsplit("/", 1)[0] for name in jobs.files}):
        np.random.seed(0)  # noqa: NPY002 (GPy's restarts draw from the global generator)
        found = emukit_nargp(*(jobs[f"{key}/{p}"] for p in parts))
        answers |= {f"{key}/{name}": value for name, value in found.items()}
        np.savez(answers_file, **answers)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
