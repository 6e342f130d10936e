"""The report: error against run time of every method on a scene, orders in words, and the audit of a run.

`report` writes a folder with one self-contained page, CSV tables and figures; `audit_page` the page of one trajectory.
"""

from .cases import Case, chosen_cases, known_cases, own_case
from .write import audit_page, report

__all__ = ["Case", "audit_page", "chosen_cases", "known_cases", "own_case", "report"]
