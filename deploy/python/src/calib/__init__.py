"""Calibration of discrete element models of granular materials, from Python.

    import calib

    with calib.connect(state="calib-state") as c:
        campaign = c.submit("sand.yaml")
        for status in c.watch(campaign):
            print(status["iteration"], status["samples_done"], status["best_misfit"])
        print(c.posterior(campaign).frame)

Numbers are SI, compression positive, with their units beside them. `calib.errors` lists what can
go wrong.
"""

from calib.answers import Document, Posterior, Samples, Status, prediction_frame
from calib.client import Client, connect
from calib.errors import (BadInput, CalibError, Conflict, Damaged, NotAllowed, NotAuthenticated, NotFound, NotNow,
                          NotTrusted, Problem, ProgramMissing, RequestFailed, ServerFull, TooLate, Unreachable)
from calib.inference_data import InferenceData

__all__ = [
    "BadInput", "CalibError", "Client", "Conflict", "Damaged", "Document", "InferenceData", "NotAllowed", "NotAuthenticated",
    "NotFound", "NotNow", "NotTrusted", "Posterior", "Problem", "ProgramMissing", "RequestFailed", "Samples", "ServerFull",
    "Status", "TooLate", "Unreachable", "connect", "prediction_frame"]
