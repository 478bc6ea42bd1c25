"""emukit's integrated variance on a given Gaussian process; run as a program.

    python acquisition_peers.py JOB.npz ANSWER.npz

The job holds x, y, variance, lengths, noise, candidates, points; the answer scores and seconds. It
runs in the interpreter that has the extra `peers`; it imports nothing of this project.
"""

import sys
import time

import GPy
import numpy as np
from emukit.core import ContinuousParameter, ParameterSpace
from emukit.experimental_design.acquisitions import IntegratedVarianceReduction
from emukit.model_wrappers import GPyModelWrapper

job = np.load(sys.argv[1])
d = job["x"].shape[1]
kernel = GPy.kern.Matern52(d, float(job["variance"]), job["lengths"], ARD=True)
model = GPy.models.GPRegression(job["x"], job["y"][:, None], kernel, noise_var=float(job["noise"]))
space = ParameterSpace([ContinuousParameter(f"x{i}", 0, 1) for i in range(d)])
acquisition = IntegratedVarianceReduction(GPyModelWrapper(model), space, job["points"])
acquisition.evaluate(job["candidates"][:10])
start, own = time.perf_counter(), time.process_time()
scores = acquisition.evaluate(job["candidates"])[:, 0]
np.savez(
    sys.argv[2],
    scores=scores,
    seconds=time.perf_counter() - start,
    processor=time.process_time() - own,
)
