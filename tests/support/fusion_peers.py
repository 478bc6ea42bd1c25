"""Multi-fidelity models of other libraries behind one function each; run as a program.

    python fusion_peers.py JOBS.npz ANSWERS.npz NAME...

Jobs hold x_low, y_low, x_high, y_high, x_test per key; answers mean, sd, seconds. It runs in the
interpreter that has the extra `peers`; it imports nothing of this project.
"""

import sys
import time
import warnings

import numpy as np

RESTARTS = 5


def emukit_data(x_low, y_low, x_high, y_high, x_test):
    from emukit.multi_fidelity.convert_lists_to_array import (
        convert_x_list_to_array,
        convert_xy_lists_to_arrays,
    )

    x, y = convert_xy_lists_to_arrays([x_low, x_high], [y_low[:, None], y_high[:, None]])
    tests = convert_x_list_to_array([x_test, x_test])
    return x, y, tests[len(x_test) :]


def emukit_ar1(x_low, y_low, x_high, y_high, x_test):
    import GPy
    from emukit.model_wrappers import GPyMultiOutputWrapper
    from emukit.multi_fidelity.kernels import LinearMultiFidelityKernel
    from emukit.multi_fidelity.models import GPyLinearMultiFidelityModel

    x, y, tests = emukit_data(x_low, y_low, x_high, y_high, x_test)
    kernels = [GPy.kern.RBF(x_low.shape[1], ARD=True) for _ in range(2)]
    model = GPyLinearMultiFidelityModel(x, y, LinearMultiFidelityKernel(kernels), n_fidelities=2)
    model.mixed_noise.Gaussian_noise.fix(1e-6)
    model.mixed_noise.Gaussian_noise_1.fix(1e-6)
    wrapped = GPyMultiOutputWrapper(model, 2, RESTARTS, verbose_optimization=False)
    wrapped.optimize()
    mean, variance = wrapped.predict(tests)
    return mean[:, 0], np.sqrt(np.maximum(variance[:, 0], 0))


def emukit_nargp(x_low, y_low, x_high, y_high, x_test):
    import GPy
    from emukit.multi_fidelity.models.non_linear_multi_fidelity_model import (
        NonLinearMultiFidelityModel,
        make_non_linear_kernels,
    )

    x, y, tests = emukit_data(x_low, y_low, x_high, y_high, x_test)
    kernels = make_non_linear_kernels(GPy.kern.RBF, 2, x_low.shape[1], {"ARD": True})
    model = NonLinearMultiFidelityModel(
        x, y, n_fidelities=2, kernels=kernels, verbose=False, optimization_restarts=RESTARTS
    )
    for m in model.models:
        m.Gaussian_noise.variance.fix(1e-6)
    model.optimize()
    mean, variance = model.predict(tests)
    return mean[:, 0], np.sqrt(np.maximum(variance[:, 0], 0))


def smt_mfk(x_low, y_low, x_high, y_high, x_test):
    from smt.applications.mfk import MFK

    model = MFK(theta0=x_low.shape[1] * [1.0], n_start=RESTARTS, print_global=False)
    model.set_training_values(x_low, y_low[:, None], name=0)
    model.set_training_values(x_high, y_high[:, None])
    model.train()
    variance = np.asarray(model.predict_variances(x_test)).reshape(-1)
    return model.predict_values(x_test)[:, 0], np.sqrt(np.maximum(variance, 0))


def botorch_mf(x_low, y_low, x_high, y_high, x_test):
    import torch
    from botorch.fit import fit_gpytorch_mll
    from botorch.models import SingleTaskMultiFidelityGP
    from botorch.models.transforms.outcome import Standardize
    from gpytorch.mlls import ExactMarginalLogLikelihood

    torch.set_num_threads(1)
    torch.manual_seed(0)
    full = [np.column_stack([x, np.full(len(x), f)]) for x, f in ((x_low, 0.0), (x_high, 1.0))]
    x = torch.tensor(np.vstack(full))
    y = torch.tensor(np.concatenate([y_low, y_high]))[:, None]
    model = SingleTaskMultiFidelityGP(
        x, y, data_fidelities=[x_low.shape[1]], outcome_transform=Standardize(m=1)
    )
    fit_gpytorch_mll(ExactMarginalLogLikelihood(model.likelihood, model))
    tests = torch.tensor(np.column_stack([x_test, np.ones(len(x_test))]))
    with torch.no_grad():
        posterior = model.posterior(tests)
        return posterior.mean[:, 0].numpy(), posterior.variance[:, 0].sqrt().numpy()


PEERS = {
    "emukit AR1": emukit_ar1,
    "emukit NARGP": emukit_nargp,
    "SMT MFK": smt_mfk,
    "BoTorch MF": botorch_mf,
}


def predict(peer, x_low, y_low, x_high, y_high, x_test):
    """Mean, sd and seconds; all see y scaled by the mean and sd of the cheap values."""
    centre, scale = y_low.mean(), y_low.std()
    np.random.seed(0)  # noqa: NPY002 (GPy's restarts draw from the global generator)
    start = time.perf_counter()
    mean, sd = PEERS[peer](
        x_low, (y_low - centre) / scale, x_high, (y_high - centre) / scale, x_test
    )
    return mean * scale + centre, sd * scale, time.perf_counter() - start


def main(jobs_file, answers_file, names):
    warnings.simplefilter("ignore")
    jobs = np.load(jobs_file)
    keys = sorted({name.rsplit("/", 1)[0] for name in jobs.files})
    parts = ("x_low", "y_low", "x_high", "y_high", "x_test")
    answers = {}
    for key in keys:
        for peer in names or PEERS:
            try:
                mean, sd, seconds = predict(peer, *(jobs[f"{key}/{p}"] for p in parts))
            except Exception as error:  # a peer's own failure is a result too
                print(f"{peer} failed at {key}: {type(error).__name__}: {error}", flush=True)
                continue
            answers[f"{key}/{peer}/mean"], answers[f"{key}/{peer}/sd"] = mean, sd
            answers[f"{key}/{peer}/seconds"] = seconds
        np.savez(answers_file, **answers)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
