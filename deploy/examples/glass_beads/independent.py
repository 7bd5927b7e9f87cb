#!/usr/bin/env python3
"""The weights of the four ensembles, computed with numpy alone: nothing of this repository takes part.

Equal starting weights, Sigma = sigma w_j y^2, in log space. A line per sigma: the one that leaves 20 of the 100 samples
effective, found by bisection, and the one that the authors' program used. --nearest: the largest effective sample size over
sigma when weights start from 1/p, as the paper's rule for later iterations has it, p estimated from the distance to the
fifth (tenth) nearest sample.
usage: CALIB_DATA=... independent.py [--nearest] [--digits N]
"""
import argparse
import os

import numpy as np

FOLDER = os.path.join(os.environ['CALIB_DATA'], 'glass_beads_oedometric', '')
AUTHORS_SIGMA = (0.44, 0.0748, 0.02206, 0.00174)
POROSITY_WEIGHT = (0.01, 0.01, 0.01, 0.02)


def load(k):
    """Parameters (100 x 4) and half the chi-squared at sigma 1 (100)."""
    states = np.genfromtxt(f'{FOLDER}ensemble_iter{k}_states.csv', delimiter=',', names=True)
    parameters = np.genfromtxt(f'{FOLDER}ensemble_iter{k}_parameters.csv', delimiter=',', skip_header=1)[:, 1:5]
    runs = np.stack([states[name] for name in ('p_MPa', 'q_MPa', 'porosity')], 1).reshape(len(parameters), -1, 3)
    measured = np.genfromtxt(FOLDER + 'experiment.dat', comments='#')[:, 1:4]
    variance = np.array([1, 1, POROSITY_WEIGHT[k]]) * measured**2
    return np.abs(parameters), 0.5 * ((runs - measured)**2 / variance).sum((1, 2))


def weights(misfit, sigma, start=0):
    log_weights = start - misfit / sigma
    result = np.exp(log_weights - log_weights.max())
    return result / result.sum()


def effective(misfit, sigma, start=0):
    return 1 / (weights(misfit, sigma, start)**2).sum()


def sigma_of(misfit, target):
    low, high = -12.0, 3.0
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if effective(misfit, 10**middle) < target else (low, middle)
    return 10**((low + high) / 2)


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument('--nearest', action='store_true')
    arguments.add_argument('--digits', type=int, default=6)
    options = arguments.parse_args()

    def number(x):
        return f'{x:.{options.digits}g}'

    for k in range(4):
        parameters, misfit = load(k)
        if options.nearest:
            scaled = parameters / [2e11, 0.5, 1e4, 0.5]
            distance = np.sqrt(((scaled[:, None] - scaled[None])**2).sum(2))
            grid = 10**np.linspace(-4, -0.5, 701)
            for neighbour in (5, 10):
                start = 4 * np.log(np.sort(distance, 1)[:, neighbour])
                size = np.array([effective(misfit, sigma, start) for sigma in grid])
                inner = np.flatnonzero((size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])) + 1
                print(k, neighbour, ', '.join(f'{grid[i]:.2g} ({size[i]:.1f})' for i in inner) or 'none')
            continue
        for sigma in (sigma_of(misfit, 20.0), AUTHORS_SIGMA[k]):
            w = weights(misfit, sigma)
            mean = w @ parameters
            cov = np.sqrt(w @ (parameters - mean)**2) / mean
            print(f'| {k} | {number(sigma)} | {number(effective(misfit, sigma))} | '
                  + ' '.join(number(m) for m in mean) + ' | ' + ' '.join(number(c) for c in cov) + ' |')


main()
