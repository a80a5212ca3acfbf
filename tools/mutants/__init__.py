"""Mutation test of the papers' requirements: their code is changed in one place at a time, and a test has to fail.

Run with ``make mutants``. `docs/requirements_code.toml` names the code of each requirement, `docs/requirements.toml`
its tests. A seed draws the changes. One counts if an assertion of a test sees it, and not if it only raises another
error. `docs/mutants.json` is the result; a test in CI checks that it belongs to code and tests.
"""
