"""Mutation test of the papers' requirements: their code is changed in one place at a time, and a test of each must fail.

Run with ``make mutants``. `docs/requirements_code.toml` names the code of each requirement, `docs/requirements.toml` its
tests. Of each requirement two changes are drawn by a seed; a change counts if an assertion of a test sees it, not if it
raises something else. `docs/mutants.json` is the result; a test in CI checks that it belongs to code and tests.
"""
