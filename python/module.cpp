// The module dccd._dccd: the core for numpy. python/dccd/__init__.py is what its users import.
#include "module.h"

PYBIND11_MODULE(_dccd, m) {
  namespace py = pybind11;
  py::options options;
  options.disable_function_signatures();  // each docstring begins with one that inspect and help() can read
  py::dtype::of<double>();  // pybind11 looks for numpy behind a static's guard: now, while no other thread can come in
  m.doc() = "The compiled part of dccd.";
  m.attr("__version__") = DCCD_VERSION;
  py::list kinds;
  for (const dccd::PairKindFacts& facts : dccd::PAIR_KINDS) kinds.append(facts.name);
  m.attr("KINDS") = py::tuple(kinds);
  m.attr("NO_INDEX") = dccd::NO_INDEX;
  m.attr("OBSTACLE_BODY") = dccd::OBSTACLE_BODY;
  dccd::python::bindMesh(m);
  dccd::python::bindBody(m);
  dccd::python::bindVoxels(m);
  dccd::python::bindOutcome(m);
  dccd::python::bindQuestions(m);
  dccd::python::bindStream(m);
}
