"""The time scikit-learn takes for the fit of BM_MixtureFit in inference_bench: the same model, ten
starts from k-means, ten components, the bound to 1e-3. Needs python3-sklearn (1.2).

    python3 tests/bench/mixture_bench.py            # one thread: OMP_NUM_THREADS=1
"""
import time
import warnings

import numpy
from sklearn.mixture import BayesianGaussianMixture

warnings.filterwarnings("ignore")
for n, d in ((100, 4), (100, 7), (500, 7), (2000, 4), (2000, 7)):
    random = numpy.random.default_rng(3)
    x = random.normal(size=(n, d)) + 3.0 * (numpy.arange(n) % 3 == 0)[:, None]
    times = []
    for repeat in range(3):
        begin = time.process_time()
        fit = BayesianGaussianMixture(
            n_components=10, n_init=10, max_iter=1000, tol=1e-3, weight_concentration_prior=0.01,
            random_state=repeat).fit(x)
        times.append(time.process_time() - begin)
    print(f"{n} x {d}: {1e3 * min(times):.0f} ms (best of 3), {fit.n_iter_} iterations of the best start")
