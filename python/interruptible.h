// Long work on behalf of a Python caller, who sees its progress and may stop it.
#pragma once

#include <pybind11/pybind11.h>

#include <functional>

#include "reference/monitor.h"

namespace lobefit::python {

namespace py = pybind11;

/// Runs `work` on a thread of its own, without the interpreter's lock. The caller's thread meanwhile hears Ctrl-C and
/// calls `progress(fraction, what)`, unless None, about ten times a second, and once at the end. What either raises
/// stops the work and is raised; a `False` of `progress` raises Interrupted.
void run_interruptibly(const py::object& progress, const std::function<void(Monitor&)>& work);

}  // namespace lobefit::python
