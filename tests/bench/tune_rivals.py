"""Two rivals of ``axialnav tune``: a sampler on the same likelihood, and the matching of mean NIS.

Both are driven by optuna's default sampler, the tree-structured Parzen estimator (Bergstra et al. 2011).  Matching the
mean NIS is the objective of Chen et al. (2018), "Weak in the NEES?".
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np
import optuna

from axialnav.fusion.config import Config
from axialnav.fusion.rehearsal import Rehearsal, Trial
from axialnav.replay.flight import Flight
from axialnav.replay.tuning.cost import Cost, Subject, undecided
from axialnav.replay.tuning.parameters import apply, parameter

TRIALS = 120
REACH = 10.0  # times smaller and larger than the start
Result = tuple[dict[str, float], int, float]


def sampled_likelihood(flight: Flight, start: Config, names: Sequence[str], trials: int = TRIALS) -> Result:
    """Settings, replays and seconds: the cost of ``axialnav tune``, minimised by sampling."""
    parameters = [parameter(start, name) for name in names]
    cost = Cost([Subject(flight.name, start, Rehearsal(start, flight.tables))], parameters, 1)
    return _sample(start, names, lambda point: cost([point])[0], trials)


def nis_matching(flight: Flight, start: Config, names: Sequence[str], trials: int = TRIALS) -> Result:
    """Settings, replays and seconds: mean NIS of every sensor brought to its number of axes."""
    parameters = [parameter(start, name) for name in names]
    rehearsal, judged = Rehearsal(start, flight.tables), undecided(start)

    def cost(point: np.ndarray) -> float:
        values = {p.name: p.value(float(x)) for p, x in zip(parameters, point, strict=True)}
        return _mean_nis_off(rehearsal.run(apply(judged, values)))

    return _sample(start, names, cost, trials)


def _mean_nis_off(trial: Trial) -> float:
    log, terms = trial.log, trial.terms
    off = 0.0
    for source in range(len(log.sensors)):
        mine = terms.used & (log.source == source)
        off += abs(np.log(terms.nis[mine].sum() / log.dof[mine].sum())) if mine.any() else 0.0
    return float(off)


def _sample(start: Config, names: Sequence[str], cost: Callable[[np.ndarray], float], trials: int) -> Result:
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    began = time.perf_counter()
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=0))
    study.enqueue_trial(dict.fromkeys(names, 0.0))
    reach = float(np.log(REACH))

    def objective(trial: optuna.Trial) -> float:
        return cost(np.array([trial.suggest_float(name, -reach, reach) for name in names]))

    study.optimize(objective, n_trials=trials)
    best = {name: parameter(start, name).value(x) for name, x in study.best_params.items()}
    return best, trials, time.perf_counter() - began
