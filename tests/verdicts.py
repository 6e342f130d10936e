"""What tests expect of the audit where steps do not resolve the motion."""

ENERGY = {"energy that no work explains", "rise of energy"}


def only_energy_of_unresolved_motion(run):
    """Nothing is wrong but the energy of oscillations that are faster than the steps, and the audit says so."""
    audit = run.audit()
    wrong = {row.name for row in audit.rows() if row.ok is False}
    assert wrong <= ENERGY, str(audit)
    assert not wrong or audit.energy.cause.startswith("motion that is not resolved, omega dt = "), str(audit)
    return bool(wrong)
