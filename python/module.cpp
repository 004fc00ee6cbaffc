// lobefit._lobefit: what the Python package calls. Names, shapes and documentation are the package's.
#include "python/module.h"

#include "models/error.h"

namespace lobefit::python {

namespace {

/// lobefit.Error and its child lobefit.Interrupted.
struct Exceptions {
  py::object error, interrupted;
};

Exceptions& exceptions() {
  // Never destroyed: that would be after the interpreter's end.
  static auto* const all = new Exceptions;
  return *all;
}

void raise(const Error& error) {
  const py::object& type = error.code() == ExitCode::interrupted ? exceptions().interrupted : exceptions().error;
  const py::object instance = type(error.what());
  instance.attr("code") = static_cast<int>(error.code());
  PyErr_SetObject(type.ptr(), instance.ptr());
}

void add_exceptions(py::module_& module) {
  const auto add = [&](const char* name, const char* doc, const py::object& base) {
    auto type = py::reinterpret_steal<py::object>(
        PyErr_NewExceptionWithDoc(("lobefit." + std::string(name)).c_str(), doc, base.ptr(), nullptr));
    module.attr(name) = type;
    return type;
  };
  exceptions().error = add("Error",
                           "What is wrong, where, and what would mend it. `code` is the exit status that the\n"
                           "command line has for it: 2 usage, 3 unreadable or invalid input, 1 internal, and so on.",
                           py::reinterpret_borrow<py::object>(PyExc_Exception));
  exceptions().interrupted = add("Interrupted", "`progress` returned False. `code` is 130.", exceptions().error);
  py::register_exception_translator([](std::exception_ptr pointer) {
    try {
      if (pointer) std::rethrow_exception(pointer);
    } catch (const Error& error) {
      raise(error);
    }
  });
}

}  // namespace

}  // namespace lobefit::python

PYBIND11_MODULE(_lobefit, module) {
  using namespace lobefit::python;
  module.attr("version") = LOBEFIT_VERSION;
  add_exceptions(module);
  add_evaluation(module);
  add_tables(module);
  add_fits(module);
}
