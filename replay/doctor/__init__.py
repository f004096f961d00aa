"""What is wrong with a recording, before any filter has seen it, and what to do about it first."""

from axialnav.replay.doctor.diagnose import diagnose
from axialnav.replay.doctor.symptom import Gravity, Symptom

__all__ = ["Gravity", "Symptom", "diagnose"]
