"""Signal processing of the corridor as pure functions: NumPy and SciPy, no ROS.

Every function takes and returns arrays; random generators are arguments. Equations are cited from
the source documents where they are implemented, with their errata (see ``docs/``).
"""
