"""Conformance: whether an implementation of a kind of equipment does what the corridor relies on.

``rail conformance KIND --command "..."`` runs it inside of a stepped corridor. What is common to
all kinds is in ``shared``, what a kind has of its own in a folder of its name: its description
(``kind.py``) and its tests, which are ordinary ones of pytest with the fixture ``bench`` and the
marker ``requirement``, which names the clause that they show.
"""
