"""Every mutant, by subject."""

from __future__ import annotations

from typing import TYPE_CHECKING

from conformance.selftest.mutants import (
    attacks,
    delivery,
    describe,
    equivalence,
    formats,
    goal,
    http_messages,
    http_methods,
    input_effects,
    input_rest,
    input_soap,
    lists,
    plan,
    pose,
    reach,
    safety,
    soap_processing,
    soap_profile,
    soap_reading,
    soap_services,
    velocity,
    wsdl,
)

if TYPE_CHECKING:
    from conformance.selftest.mutants.mutant import Mutant

_SUBJECTS = (
    reach,
    pose,
    velocity,
    lists,
    goal,
    plan,
    delivery,
    formats,
    http_methods,
    http_messages,
    soap_services,
    soap_reading,
    soap_profile,
    soap_processing,
    input_rest,
    input_soap,
    input_effects,
    attacks,
    equivalence,
    safety,
    wsdl,
    describe,
)
MUTANTS: tuple[Mutant, ...] = tuple(mutant for subject in _SUBJECTS for mutant in subject.MUTANTS)
