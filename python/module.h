// The parts of the module, each of which adds its functions.
#pragma once

#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

namespace lobefit::python {

namespace py = pybind11;

void add_evaluation(py::module_& module);
void add_tables(py::module_& module);
void add_fits(py::module_& module);

}  // namespace lobefit::python
