"""The figures and tables of the papers that clothsim implements, each one command.

| file | what it holds |
|---|---|
| `catalogue` | every figure and table of both papers, and its state |
| `contract` | what the module of a figure offers, and what it is given |
| `job` | one figure from measurement to files |
| `kes` | the thesis's units, its fabrics |
| `benchmarks` | the scenes of chapters 5 and 6: data, and meshes in motion (`moving`) made by `knots` and `pushed` |
| `counting`, `timings` | what detection on a GPU takes on them |
| `snapshots` | these scenes in pictures, and what makes them hard |
| `whole_steps` | steps that the engine does not cut, so that a path is known at each |
| `pictures` | one style for plots and rendered tiles |
| `figure_…`, `table_…` | one figure or table each |

A figure that becomes reproducible is one more module, with the names of `contract.Reproduction`, and its name in the
catalogue.
"""

from clothsim.reproduce.catalogue import CATALOGUE, Entry, find
from clothsim.reproduce.contract import Check, Effort, Table
from clothsim.reproduce.job import Outcome, reproduce

__all__ = ["CATALOGUE", "Check", "Effort", "Entry", "Outcome", "Table", "find", "reproduce"]
