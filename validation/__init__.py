"""Physical validation: the engine against closed forms, solutions of equations and measured fabrics.

``python -m validation`` (``make validation``) runs all tests, writes ``validation/results.csv``, the tables of single
tests and one plot each. Targets with their sources are in ``validation/targets.csv``; docs/validation.md tells how to
read them.
"""
